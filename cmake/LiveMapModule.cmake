# livemap_module(NAME [UNTRACED] SOURCES a.cpp ... DEPENDS target ... [SYSTEM_INCLUDES dir ...])
#
# One ROS-free module: the static library livemap_NAME of sources below src/NAME, its headers
# included by their path there. DEPENDS spells out every library that the module may use. UNTRACED
# is a module of loops over pixels and numbers: what they compare teaches a fuzzer nothing, and telling
# it takes more time than the loops.
function(livemap_module name)
  cmake_parse_arguments(MODULE "UNTRACED" "" "SOURCES;DEPENDS;SYSTEM_INCLUDES" ${ARGN})
  add_library(livemap_${name} STATIC ${MODULE_SOURCES})
  target_include_directories(livemap_${name} PUBLIC ${PROJECT_SOURCE_DIR}/src)
  target_include_directories(livemap_${name} SYSTEM PUBLIC ${MODULE_SYSTEM_INCLUDES})
  target_link_libraries(livemap_${name} PUBLIC ${MODULE_DEPENDS} PRIVATE livemap_options)
  if(LIVEMAP_FUZZ)
    # What leads the fuzzer. The modules' unit tests run with it, too.
    target_compile_options(livemap_${name} PRIVATE -fsanitize=fuzzer-no-link
      $<$<BOOL:${MODULE_UNTRACED}>:-fno-sanitize-coverage=trace-cmp>)
  endif()
endfunction()

# livemap_gtest(NAME [COMPUTES] SOURCES a_test.cpp ... [THREADED b_test.cpp ...] DEPENDS target ...)
#
# A GoogleTest program that ctest runs as NAME. Tests that want files of the source tree read
# LIVEMAP_SOURCE_DIR; the ones that want the real drives read LIVEMAP_DATA_DIR (environment, else
# ../shared/data beside the source tree) and say "skipped, no data" where it is absent. Sources named
# by THREADED have several threads: ThreadSanitizer's build of the program has these alone, as the
# others take minutes to compile and tell it nothing. COMPUTES is a program whose own sources, or the templates that they
# use, have much to compute: pictures, long JSON.
if(LIVEMAP_DEVELOPMENT)
  find_package(GTest REQUIRED)
endif()
# All of them, without what they do not need.
add_custom_target(livemap_gtests)
function(livemap_gtest name)
  cmake_parse_arguments(TEST "COMPUTES" "" "SOURCES;THREADED;DEPENDS" ${ARGN})
  if(TEST_THREADED AND LIVEMAP_SANITIZE MATCHES "thread")
    set(TEST_SOURCES)
  endif()
  list(APPEND TEST_SOURCES ${TEST_THREADED})
  list(TRANSFORM TEST_SOURCES PREPEND ${PROJECT_SOURCE_DIR}/test/)
  if(NOT LIVEMAP_DEVELOPMENT)
    # Declared, for the properties that folders set on it; never built.
    add_executable(${name} EXCLUDE_FROM_ALL ${TEST_SOURCES})
    set_target_properties(${name} PROPERTIES LIVEMAP_IS_TEST ON)
    add_test(NAME ${name} COMMAND ${name})
    return()
  endif()
  add_executable(${name} ${TEST_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${name} PRIVATE LIVEMAP_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_libraries(${name} PRIVATE ${TEST_DEPENDS} GTest::gmock GTest::gtest_main livemap_options)
  livemap_link_fast(${name})
  if(NOT TEST_COMPUTES AND NOT livemap_simulation IN_LIST TEST_DEPENDS)
    # Half the time to compile, and hardly more to run.
    target_compile_options(${name} PRIVATE -O0)
  endif()
  set_target_properties(${name} PROPERTIES LIVEMAP_IS_TEST ON)
  add_dependencies(livemap_gtests ${name})
  get_property(opened GLOBAL PROPERTY LIVEMAP_OPENED_LIBRARIES)
  if(opened)
    add_dependencies(${name} ${opened})
  endif()
  add_test(NAME ${name} COMMAND ${name})
  set_tests_properties(${name} PROPERTIES TIMEOUT 600)
endfunction()

# livemap_targets_below(folder TYPES result)
#
# The targets, but for tests, that a folder and those below it define; TYPES is a regular expression.
function(livemap_targets_below folder types result)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  set(found)
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    get_target_property(is_test ${target} LIVEMAP_IS_TEST)
    if(type MATCHES "^${types}$" AND NOT is_test)
      list(APPEND found ${target})
    endif()
  endforeach()
  get_property(folders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(below IN LISTS folders)
    livemap_targets_below(${below} ${types} more)
    list(APPEND found ${more})
  endforeach()
  set(${result} ${found} PARENT_SCOPE)
endfunction()

# livemap_part(NAME folder ...)
#
# The target NAME: all programs and plugin libraries of these folders, and the libraries that they open. ./livemap
# builds one where the build folder has more than a command runs.
function(livemap_part name)
  add_custom_target(${name})
  get_property(opened GLOBAL PROPERTY LIVEMAP_OPENED_LIBRARIES)
  if(opened)
    add_dependencies(${name} ${opened})
  endif()
  foreach(folder IN LISTS ARGN)
    livemap_targets_below(${PROJECT_SOURCE_DIR}/${folder} "(EXECUTABLE|SHARED_LIBRARY)" programs)
    add_dependencies(${name} ${programs})
  endforeach()
endfunction()
