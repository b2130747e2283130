# Error against time, from bench/accuracy's table: a panel for each of six scenes, and in each the Pareto front, the settings
# that no other one beats in both.
#   gnuplot -e "table='OUT.tsv'; picture='OUT.png'" bench/accuracy.gnuplot
set terminal pngcairo size 1280,1500 font "DejaVu Sans,10" background rgb "white"
set output picture
set datafile separator "\t"
set logscale xy
set xlabel "CPU time, s (one thread)"
set ylabel "RMS error of the power image, dB"
set grid lc rgb "#dddddd"
set key bottom right font ",8" samplen 1
set xrange [0.02:600]
set yrange [0.002:3]
set format y "%g"
set format x "%g"

rows(scene, what) = sprintf("< awk -F'\\t' '$1 == \"%s\" && (%s) {print $3 \"\\t\" $7 \"\\t\" $2}' '%s'", scene, what, table)
# Sorted by time; kept where the error is the least so far. Polar and uniform sampling's time is another program's.
front(scene) = sprintf("< awk -F'\\t' '$1 == \"%s\" && $2 !~ /polar|uniform/ {print $3 \"\\t\" $7}' '%s' | sort -g | \
    awk -F'\\t' 'NR == 1 || $2 < best {best = $2; print}'", scene, table)

scenes = "'inland_empire 2134 m, culture' 'inland_empire 2134 m, bare' 'inland_empire 838 m, culture' \
'inland_empire 150 m above ground, bare' 'worcester 1400 m, culture' 'beam 6 deg, 838 m, culture'"
set multiplot layout 3,2
do for [i = 1:words(scenes)] {
    s = word(scenes, i)
    set title s noenhanced
    plot rows(s, "$2 ~ /polar/") using 1:2 with points pt 6 lc rgb "#999999" title "polar steps (the reference's code)", \
         rows(s, "$2 ~ /uniform/") using 1:2 with points pt 12 lc rgb "#777700" title "uniform grid (the reference's code)", \
         rows(s, "$2 ~ /one axis/") using 1:2 with points pt 2 lc rgb "#cc7700" title "lines of one axis, 16 spokes a bin", \
         rows(s, "$2 ~ / 2 a bin, lead 4$/") using 1:2 with points pt 8 lc rgb "#0060ad" title "2 spokes a bin, lead 4", \
         rows(s, "$2 ~ / 4 a bin, lead 4$/") using 1:2 with points pt 4 lc rgb "#0060ad" title "4 spokes a bin, lead 4", \
         rows(s, "$2 ~ / 8 a bin, lead 4$/") using 1:2 with points pt 10 lc rgb "#0060ad" title "8 spokes a bin, lead 4", \
         rows(s, "$2 ~ / 8 a bin, lead [128]$/") using 1:2 with points pt 1 lc rgb "#0060ad" title "8 spokes a bin, other leads", \
         rows(s, "$2 ~ / 16 a bin, lead 4$/") using 1:2 with points pt 5 lc rgb "#0060ad" title "16 spokes a bin, lead 4", \
         rows(s, "$2 ~ / 32 a bin, lead 4$/") using 1:2 with points pt 7 lc rgb "#0060ad" title "32 spokes a bin, lead 4", \
         front(s) using 1:2 with steps lc rgb "#88aadd" title "Pareto front", \
         rows(s, "$2 ~ /^quality/") using 1:2:(substr(strcol(3), 9, 20)) with labels offset 0,-0.8 font ",9" tc rgb "#aa0000" notitle, \
         rows(s, "$2 ~ /^quality/") using 1:2 with points pt 3 ps 1.4 lc rgb "#aa0000" title "qualities"
}
unset multiplot
