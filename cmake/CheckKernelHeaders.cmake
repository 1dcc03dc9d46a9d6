# SPDX-License-Identifier: Apache-2.0
# Where nvcc is present, the build compiles all kernel headers with it: the same source must do for host and device. Calls of
# host functions from device functions are errors. Without nvcc there is nothing to do, and a build with sanitizers would only
# repeat what the others check: they change nothing for nvcc.
if(VIRGA_SANITIZE)
  return()
endif()
find_program(VIRGA_NVCC nvcc HINTS /usr/local/cuda/bin DOC "CUDA compiler that checks kernel headers")
if(NOT VIRGA_NVCC)
  message(STATUS "No nvcc: kernel headers are compiled for the host alone")
  return()
endif()
execute_process(COMMAND ${VIRGA_NVCC} --version OUTPUT_VARIABLE nvcc_version ERROR_QUIET)
string(REGEX MATCH "release ([0-9]+)\\.([0-9]+)" nvcc_release "${nvcc_version}")
if(NOT nvcc_release OR CMAKE_MATCH_1 LESS 12)
  message(STATUS "${VIRGA_NVCC} does not know C++20: kernel headers are compiled for the host alone")
  return()
endif()

# A kernel header is one that marks a function for the device.
file(GLOB_RECURSE headers RELATIVE ${CMAKE_SOURCE_DIR}/src CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/src/*.h)
set(kernel_includes "")
foreach(header IN LISTS headers)
  file(STRINGS ${CMAKE_SOURCE_DIR}/src/${header} marks REGEX "VIRGA_HD" LIMIT_COUNT 1)
  if(marks)
    string(APPEND kernel_includes "#include \"${header}\"\n")
  endif()
endforeach()
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/kernels/kernel_headers.h CONTENT "${kernel_includes}" @ONLY)

set(kernel_flags -std=c++20 --expt-relaxed-constexpr -arch=sm_80 -Werror all-warnings -ccbin ${CMAKE_CXX_COMPILER}
    -I${CMAKE_SOURCE_DIR}/src -I${CMAKE_BINARY_DIR}/kernels)
# Compensation of virtual lights recurses; how deep, a launcher says by the stack that it sets.
list(APPEND kernel_flags -Xptxas --suppress-stack-size-warning)
# Nothing runs what it makes, and optimising it takes nine tenths of the time.
execute_process(COMMAND ${VIRGA_NVCC} --help OUTPUT_VARIABLE nvcc_help ERROR_QUIET)
if(nvcc_help MATCHES "-Ofast-compile")
  list(APPEND kernel_flags --Ofast-compile=max)
endif()
get_target_property(nanovdb_folders NanoVDB::NanoVDB INTERFACE_INCLUDE_DIRECTORIES)
foreach(folder IN LISTS nanovdb_folders)
  if(folder AND NOT folder IN_LIST CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES)
    list(APPEND kernel_flags -isystem ${folder})
  endif()
endforeach()

set(kernel_object ${CMAKE_BINARY_DIR}/kernels/check_kernels.o)
add_custom_command(
  OUTPUT ${kernel_object}
  COMMAND ${VIRGA_NVCC} ${kernel_flags} -MD -MF ${kernel_object}.d -MT ${kernel_object} -c
          ${CMAKE_SOURCE_DIR}/cmake/check_kernels.cu -o ${kernel_object}
  DEPENDS ${CMAKE_SOURCE_DIR}/cmake/check_kernels.cu ${CMAKE_BINARY_DIR}/kernels/kernel_headers.h
  DEPFILE ${kernel_object}.d
  COMMENT "Compiling kernel headers with nvcc"
  VERBATIM)
add_custom_target(virga_kernel_check ALL DEPENDS ${kernel_object})
