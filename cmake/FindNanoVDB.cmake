# SPDX-License-Identifier: Apache-2.0
# Header-only. Defines NanoVDB::NanoVDB.
find_path(NanoVDB_INCLUDE_DIR nanovdb/NanoVDB.h)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(NanoVDB REQUIRED_VARS NanoVDB_INCLUDE_DIR)
if(NanoVDB_FOUND AND NOT TARGET NanoVDB::NanoVDB)
  add_library(NanoVDB::NanoVDB INTERFACE IMPORTED)
  target_include_directories(NanoVDB::NanoVDB SYSTEM INTERFACE ${NanoVDB_INCLUDE_DIR})
endif()
