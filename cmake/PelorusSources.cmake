# SPDX-License-Identifier: MIT
# The library's sources. A room that is left out is replaced by the file of its name in src/absent.
function(pelorus_sources result root)
  file(GLOB sources CONFIGURE_DEPENDS "${root}/src/*/*.c")
  foreach(room supervise known_map)
    string(TOUPPER "PLR_${room}" option)
    if(DEFINED ${option} AND NOT ${option})
      list(FILTER sources EXCLUDE REGEX "/src/${room}/")
    else()
      list(FILTER sources EXCLUDE REGEX "/src/absent/${room}\\.c$")
    endif()
  endforeach()
  set(${result} "${sources}" PARENT_SCOPE)
endfunction()
