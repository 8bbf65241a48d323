# Helpers that every module uses, so that warnings and sanitizers are the same everywhere
# without touching global flags.

# voxeld_options(<target>): warnings, sanitizers, arithmetic and the repository root as include directory.
# Folders without loops over triangles, voxels or pixels set VOXELD_CONTROL_PLANE.
function(voxeld_options target)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
                                           -Wno-sign-conversion)
  # No fused multiply-add, which processors of some kinds have and others not: results are the same bytes on
  # every machine. Sources whose kernels are exact with it say otherwise for themselves.
  target_compile_options(${target} PRIVATE -ffp-contract=off)
  # No path of the machine in programs (__FILE__), and one entry of a compiler cache for all clones.
  target_compile_options(${target} PRIVATE -fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)
  # Code that waits for sockets, files and SQLite: a build for use takes a quarter less time for it at -O1.
  if(VOXELD_CONTROL_PLANE)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
  # A jumbo unit includes sources, which is what it is for.
  set_target_properties(${target} PROPERTIES UNITY_BUILD_CODE_BEFORE_INCLUDE
                        "// NOLINTNEXTLINE(bugprone-suspicious-include)")
  # GCC collects garbage at 128 MB; units of a build for use need 500 MB to 1 GB anyway.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:SHELL:--param ggc-min-heapsize=524288>)
  endif()
  if(VOXELD_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    target_compile_options(${target} PRIVATE -Wthread-safety)
  endif()
  if(VOXELD_SANITIZE)
    target_compile_options(${target} PUBLIC -fsanitize=${VOXELD_SANITIZE}
                                            -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${VOXELD_SANITIZE})
  endif()
endfunction()

# voxeld_library(<name> SOURCES a.cpp ... [PUBLIC lib ...] [PRIVATE lib ...])
# One library per module: its target_link_libraries are the architecture diagram.
#
# With VOXELD_MERGE_FOLDERS, the libraries of folders that set VOXELD_MERGED to the same name become
# one, so that jumbo units of all their sources read each header and make each template once: most
# of the time of a build from nothing. The library of that name has the sources; theirs point to it.
function(voxeld_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  if(NOT (VOXELD_MERGE_FOLDERS AND VOXELD_MERGED))
    add_library(${name} STATIC ${ARG_SOURCES})
    voxeld_options(${name})
    target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
    return()
  endif()
  if(NOT TARGET ${VOXELD_MERGED})
    add_library(${VOXELD_MERGED} STATIC)
    voxeld_options(${VOXELD_MERGED})
  endif()
  target_sources(${VOXELD_MERGED} PRIVATE ${ARG_SOURCES})
  get_target_property(merged ${VOXELD_MERGED} VOXELD_MERGED_NAMES)
  list(REMOVE_ITEM ARG_PUBLIC ${merged})
  list(REMOVE_ITEM ARG_PRIVATE ${merged})
  target_link_libraries(${VOXELD_MERGED} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  set_property(TARGET ${VOXELD_MERGED} APPEND PROPERTY VOXELD_MERGED_NAMES ${name})
  add_library(${name} INTERFACE)
  target_link_libraries(${name} INTERFACE ${VOXELD_MERGED})
endfunction()

# voxeld_test(<name> SOURCES a.cpp ... LIBS lib ... [LABEL l] [WHOLE] [COMPUTES]) makes one gtest
# binary, one ctest entry and the label that `ctest -L` selects by.
#
# COMPUTES: loops in the test's own sources are most of its time, so that they are optimized as the
# preset says. Others take half the time to compile without.
#
# WHOLE: tests choose between two lists of parameters (tests/unit/long_form.h). The entry takes the
# short ones. A second entry, <name>.whole of label long, takes the whole ones.
function(voxeld_test name)
  cmake_parse_arguments(ARG "WHOLE;COMPUTES" "LABEL;TIMEOUT" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  voxeld_options(${name})
  # More sources would be fewer units than cores.
  set_target_properties(${name} PROPERTIES UNITY_BUILD_BATCH_SIZE 12)
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} GTest::gtest GTest::gmock GTest::gtest_main)
  if(NOT ARG_COMPUTES)
    target_compile_options(${name} PRIVATE -O0)
    if(NOT VOXELD_SANITIZE)
      target_compile_options(${name} PRIVATE -g0)
    endif()
  endif()
  add_test(NAME ${name} COMMAND ${name})
  if(NOT ARG_TIMEOUT)
    # The limit is there for what hangs. Some programs wait for thousands of fsyncs, which take
    # 20 times longer on a disk that others write to.
    set(ARG_TIMEOUT 1800)
  endif()
  if(VOXELD_SANITIZE)
    # Sanitizers make programs several times slower.
    math(EXPR ARG_TIMEOUT "6 * ${ARG_TIMEOUT}")
  endif()
  set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABEL}" TIMEOUT ${ARG_TIMEOUT})
  if(ARG_WHOLE)
    # Without the label unit, by which the step of the sanitizers selects.
    add_test(NAME ${name}.whole COMMAND ${name})
    set_tests_properties(${name}.whole PROPERTIES LABELS long TIMEOUT ${ARG_TIMEOUT}
                         ENVIRONMENT VOXELD_LONG=1)
  endif()
endfunction()

# voxeld_gpu_test(<name> SOURCES ... LIBS ... [DEVICES ...] [SMOKE Suite.test ...] [WHOLE]) makes one
# binary and one ctest entry for each software driver, or for DEVICES alone; the binary takes the
# device from VOXELD_TEST_DEVICE.
#
# SMOKE: llvmpipe runs all tests, the other drivers these alone (patterns of gtest): each pass, each
# pipeline and each kind of result at least once, against the CPU or an oracle. Entries
# <name>.<device>.whole of label long run all tests on the other drivers.
# WHOLE: as in voxeld_test, on each driver.
function(voxeld_gpu_test name)
  cmake_parse_arguments(ARG "WHOLE" "TIMEOUT" "SOURCES;LIBS;DEVICES;SMOKE" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  voxeld_options(${name})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} GTest::gtest GTest::gmock GTest::gtest_main)
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 600)
  endif()
  if(NOT ARG_DEVICES)
    set(ARG_DEVICES llvmpipe lavapipe osmesa)
  endif()
  foreach(device IN LISTS ARG_DEVICES)
    set(is_smoke FALSE)
    if(ARG_SMOKE AND NOT device STREQUAL "llvmpipe")
      set(is_smoke TRUE)
    endif()
    if(is_smoke)
      add_test(NAME ${name}.${device}
               COMMAND ${PROJECT_SOURCE_DIR}/tests/gpu/run_some.sh $<TARGET_FILE:${name}> ${ARG_SMOKE})
    else()
      add_test(NAME ${name}.${device} COMMAND ${name})
    endif()
    set_tests_properties(${name}.${device} PROPERTIES LABELS gpu TIMEOUT ${ARG_TIMEOUT}
                         ENVIRONMENT "VOXELD_TEST_DEVICE=${device}")
    if(is_smoke OR ARG_WHOLE)
      add_test(NAME ${name}.${device}.whole COMMAND ${name})
      set_tests_properties(${name}.${device}.whole PROPERTIES
                           LABELS "gpu;long" TIMEOUT ${ARG_TIMEOUT} RUN_SERIAL TRUE
                           ENVIRONMENT "VOXELD_TEST_DEVICE=${device};VOXELD_LONG=1")
    endif()
  endforeach()
endfunction()
