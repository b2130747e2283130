# Libraries as archives, for a program that has to be there at once: to find, map and bind libtiff alone with the seven behind
# it takes longer than to read a small scene. For targets with the property WEDGESCOPE_LATE_LIBRARIES; tests and benchmarks are
# linked with GDAL, which brings the shared ones, and two copies of a library in one program would share its names.
option(WEDGESCOPE_ARCHIVES "link the program with archives of its libraries where the system has them all" ON)
include(CheckCXXSourceCompiles)
include(CMakePushCheckState)

function(find_archives)
  # All or none. libtiff's JBIG stays shared: it is under the GPL.
  set(found "")
  foreach(name IN ITEMS tiff png16 webp Lerc lzma jpeg deflate zstd z xxhash boost_program_options GeographicLib)
    if(NOT EXISTS "${ARCHIVE_${name}}")
      unset(ARCHIVE_${name} CACHE)
    endif()
    find_library(ARCHIVE_${name} lib${name}.a)
    mark_as_advanced(ARCHIVE_${name})
    if(NOT ARCHIVE_${name})
      set(WEDGESCOPE_ARCHIVES_LINK OFF PARENT_SCOPE)
      message(STATUS "lib${name}.a is not there: the program is linked with shared libraries")
      return()
    endif()
    list(APPEND found ${ARCHIVE_${name}})
  endforeach()
  if(NOT "${WEDGESCOPE_ARCHIVES_TRIED}" STREQUAL "${found}")
    unset(WEDGESCOPE_ARCHIVES_LINK CACHE)
    set(WEDGESCOPE_ARCHIVES_TRIED "${found}" CACHE INTERNAL "what WEDGESCOPE_ARCHIVES_LINK was found for")
  endif()
  cmake_push_check_state(RESET)
  set(CMAKE_REQUIRED_LIBRARIES ${found} jbig)
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
        return TIFFOpenExt(\"a\", \"r\", TIFFOpenOptionsAlloc()) && png_access_version_number() && ZSTD_createDCtx() &&
               XXH3_64bits(&x, 8) && zlibVersion() && count;
    }" WEDGESCOPE_ARCHIVES_LINK)
  cmake_pop_check_state()
endfunction()

if(WEDGESCOPE_ARCHIVES)
  find_archives()
else()
  set(WEDGESCOPE_ARCHIVES_LINK OFF)
endif()

# What stands in target_link_libraries for `linked` libraries (a list) of which these are the archives: those, for a target with that
# property.
function(archives_or out linked)
  if(NOT WEDGESCOPE_ARCHIVES_LINK)
    set(${out} "$<1:${linked}>" PARENT_SCOPE)
    return()
  endif()
  set(archives "")
  foreach(name IN LISTS ARGN)
    if(ARCHIVE_${name})
      list(APPEND archives ${ARCHIVE_${name}})
    else()
      list(APPEND archives ${name})
    endif()
  endforeach()
  set(${out} "$<IF:$<BOOL:$<TARGET_PROPERTY:WEDGESCOPE_LATE_LIBRARIES>>,${archives},${linked}>" PARENT_SCOPE)
endfunction()
