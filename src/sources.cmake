# SPDX-License-Identifier: MIT
# The library's sources, for every build: it stands beside them, so that src, include and a port are all that a
# build on another system has to take. A room that is left out is replaced by the file of its name in absent;
# nothing inside the library calls vision or eyes, so nothing stands in for them.
function(pelorus_sources result)
  file(GLOB sources CONFIGURE_DEPENDS "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/*/*.c")
  foreach(room supervise known_map)
    string(TOUPPER "PLR_${room}" option)
    if(DEFINED ${option} AND NOT ${option})
      list(FILTER sources EXCLUDE REGEX "/src/${room}/")
    else()
      list(FILTER sources EXCLUDE REGEX "/src/absent/${room}\\.c$")
    endif()
  endforeach()
  if(DEFINED PLR_VISION AND NOT PLR_VISION)
    list(FILTER sources EXCLUDE REGEX "/src/(vision|eyes)/")
  endif()
  set(${result} "${sources}" PARENT_SCOPE)
endfunction()
