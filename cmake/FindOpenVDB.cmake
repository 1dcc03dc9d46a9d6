# SPDX-License-Identifier: Apache-2.0
# Debian's OpenVDB has no CMake config. Defines OpenVDB::OpenVDB.
find_path(OpenVDB_INCLUDE_DIR openvdb/openvdb.h)
find_library(OpenVDB_LIBRARY openvdb)
find_package(Boost REQUIRED COMPONENTS iostreams)
find_package(TBB REQUIRED)
find_package(Imath REQUIRED)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenVDB REQUIRED_VARS OpenVDB_LIBRARY OpenVDB_INCLUDE_DIR)
if(OpenVDB_FOUND AND NOT TARGET OpenVDB::OpenVDB)
  add_library(OpenVDB::OpenVDB UNKNOWN IMPORTED)
  set_target_properties(OpenVDB::OpenVDB PROPERTIES
    IMPORTED_LOCATION ${OpenVDB_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${OpenVDB_INCLUDE_DIR}
    INTERFACE_LINK_LIBRARIES "Boost::iostreams;TBB::tbb;Imath::Imath")
endif()
