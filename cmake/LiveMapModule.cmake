# livemap_module(NAME SOURCES a.cpp ... DEPENDS target ... [SYSTEM_INCLUDES dir ...])
#
# One ROS-free module: the static library livemap_NAME its sources below src/, its headers
# included by their path there. DEPENDS spells out every library that the module may use.
function(livemap_module name)
  cmake_parse_arguments(MODULE "" "" "SOURCES;DEPENDS;SYSTEM_INCLUDES" ${ARGN})
  add_library(livemap_${name} STATIC ${MODULE_SOURCES})
  target_include_directories(livemap_${name} PUBLIC ${PROJECT_SOURCE_DIR}/src)
  target_include_directories(livemap_${name} SYSTEM PUBLIC ${MODULE_SYSTEM_INCLUDES})
  target_link_libraries(livemap_${name} PUBLIC ${MODULE_DEPENDS} PRIVATE livemap_options)
endfunction()

# livemap_gtest(NAME SOURCES a_test.cpp ... DEPENDS target ...)
#
# A GoogleTest program that ctest runs as NAME. Tests that want files of the source tree read
# LIVEMAP_SOURCE_DIR; the ones that want the real drives read LIVEMAP_DATA_DIR (environment, else
# ../shared/data beside the source tree) and say "skipped, no data" where it is absent.
find_package(GTest REQUIRED)
# All of them, without what they do not need.
add_custom_target(livemap_gtests)
function(livemap_gtest name)
  cmake_parse_arguments(TEST "" "" "SOURCES;DEPENDS" ${ARGN})
  list(TRANSFORM TEST_SOURCES PREPEND ${PROJECT_SOURCE_DIR}/test/)
  add_executable(${name} ${TEST_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${name} PRIVATE LIVEMAP_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_libraries(${name} PRIVATE ${TEST_DEPENDS} GTest::gmock GTest::gtest_main livemap_options)
  add_dependencies(livemap_gtests ${name})
  add_test(NAME ${name} COMMAND ${name})
  set_tests_properties(${name} PROPERTIES TIMEOUT 600)
endfunction()
