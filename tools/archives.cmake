# Libraries as archives, for a program that has to be there at once: to find, map and bind libtiff alone with the seven behind
# it takes longer than to read a small scene. For targets with the property WEDGESCOPE_LATE_LIBRARIES; tests and benchmarks are
# linked with GDAL, which brings the shared ones, and two copies of a library in one program would share its names.
include(CheckCXXSourceCompiles)

set(archives tiff png16 webp Lerc lzma jpeg deflate zstd z xxhash boost_program_options GeographicLib)
set(WEDGESCOPE_ARCHIVES "")
foreach(name IN LISTS archives)
  find_library(ARCHIVE_${name} lib${name}.a)
  mark_as_advanced(ARCHIVE_${name})
  list(APPEND WEDGESCOPE_ARCHIVES ${ARCHIVE_${name}})
endforeach()
# libtiff's JBIG stays shared: its licence is not for programs that are handed on whole.
list(APPEND WEDGESCOPE_ARCHIVES jbig)

set(CMAKE_REQUIRED_LIBRARIES ${WEDGESCOPE_ARCHIVES})
check_cxx_source_compiles("
  #include <png.h>
  #include <tiffio.h>
  #include <xxhash.h>
  #include <zlib.h>
  #include <zstd.h>
  #include <GeographicLib/UTMUPS.hpp>
  #include <boost/program_options.hpp>
  int main(int count, char**) {
      boost::program_options::options_description all;
      all.add_options()(\"a\", \"b\");
      double x = 0, y = 0;
      int zone = 0;
      bool north = true;
      GeographicLib::UTMUPS::Forward(1, 2, zone, north, x, y);
      return TIFFOpen(\"a\", \"r\") && png_access_version_number() && ZSTD_createDCtx() && XXH3_64bits(&x, 8) &&
             zlibVersion() && count;
  }" WEDGESCOPE_ARCHIVES_LINK)
unset(CMAKE_REQUIRED_LIBRARIES)

# What stands for `linked` libraries (a list) in target_link_libraries: for a target with that property their archives and whatever
# those need.
function(archives_or out linked)
  if(WEDGESCOPE_ARCHIVES_LINK)
    set(late "$<BOOL:$<TARGET_PROPERTY:WEDGESCOPE_LATE_LIBRARIES>>")
    set(${out} "$<IF:${late},${WEDGESCOPE_ARCHIVES},${linked}>" PARENT_SCOPE)
  else()
    set(${out} "${linked}" PARENT_SCOPE)
  endif()
endfunction()
