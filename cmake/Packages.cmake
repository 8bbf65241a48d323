# Debian packages by CPack, as docker/build-packages makes them: the daemon with its service, the CLI,
# the client library, what building against it needs, and the Python package.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME voxeld)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "voxeld maintainers <voxeld@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL server cli client dev python)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_BINARY_DIR}/lib)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS ON)

set(CPACK_DEBIAN_SERVER_PACKAGE_NAME voxeld)
set(CPACK_DEBIAN_SERVER_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_SERVER_DESCRIPTION "voxelization and ray marching over HTTP, on a GPU that many share
 POST a mesh or an animation and get a compressed voxel grid or an image. Works on
 OpenGL without a display, on Mesa's software drivers, and on the CPU alone, with the
 same bytes in the response.")
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS adduser)
# Loaded at run time: without them there is device cpu.
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS "libegl1, libegl-mesa0, libgl1-mesa-dri")
set(CPACK_DEBIAN_SERVER_PACKAGE_SUGGESTS "voxel, libosmesa6, mesa-vulkan-drivers, nginx")
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA
    ${PROJECT_SOURCE_DIR}/docker/debian/conffiles
    ${PROJECT_SOURCE_DIR}/docker/debian/postinst
    ${PROJECT_SOURCE_DIR}/docker/debian/postrm
    ${PROJECT_SOURCE_DIR}/docker/debian/prerm)

set(CPACK_DEBIAN_CLI_PACKAGE_NAME voxel)
set(CPACK_DEBIAN_CLI_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_CLI_DESCRIPTION "command line of voxeld
 Voxelizes and renders meshes and animations by a voxeld that may run elsewhere.")
set(CPACK_COMPONENT_CLI_DEPENDS client)

set(CPACK_DEBIAN_CLIENT_PACKAGE_NAME libvoxeld-client${PROJECT_VERSION_MAJOR})
set(CPACK_DEBIAN_CLIENT_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_CLIENT_DESCRIPTION "client library of voxeld
 Uploads, jobs, grids and images of a voxeld, and the decoder of its containers.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libvoxeld-client-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_DESCRIPTION "client library of voxeld, to build against
 Header, CMake package voxeld and pkg-config file voxeld_client.")
set(CPACK_COMPONENT_DEV_DEPENDS client)

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-voxeld)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_PYTHON_DESCRIPTION "voxel grids of meshes as numpy arrays, from a voxeld
 Voxelizes files, arrays and meshes of other libraries by a voxeld that may run elsewhere,
 and gives the voxels as numpy arrays, files and images.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11), python3-numpy")
# The decoder, without which grids come as .npz, and a daemon of one's own.
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS
    "libvoxeld-client${PROJECT_VERSION_MAJOR} (>= ${PROJECT_VERSION}), voxel, voxeld")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-tqdm, python3-open3d, python3-torch")
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA
    ${PROJECT_SOURCE_DIR}/docker/debian/python/postinst
    ${PROJECT_SOURCE_DIR}/docker/debian/python/prerm)

foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} upper)
  install(FILES docker/debian/copyright
    DESTINATION share/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME} COMPONENT ${component})
endforeach()

# Where Debian's python3 looks for packages. The metadata tells pip of it.
set(voxeld_python_dir lib/python3/dist-packages)
install(DIRECTORY python/voxeld DESTINATION ${voxeld_python_dir} COMPONENT python
  FILES_MATCHING PATTERN "*.py" PATTERN py.typed PATTERN __pycache__ EXCLUDE)
configure_file(docker/debian/python/METADATA.in METADATA @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/METADATA
  DESTINATION ${voxeld_python_dir}/voxeld-${PROJECT_VERSION}.dist-info COMPONENT python)

# Other prefixes than /usr have their own etc.
if(CMAKE_INSTALL_PREFIX STREQUAL "/usr")
  set(VOXELD_DEFAULTS_DIR /etc/default)
  set(defaults_destination /etc/default)
else()
  set(VOXELD_DEFAULTS_DIR ${CMAKE_INSTALL_PREFIX}/etc/default)
  set(defaults_destination etc/default)
endif()
configure_file(docker/debian/voxeld.service.in voxeld.service @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/voxeld.service
  DESTINATION lib/systemd/system COMPONENT server)
install(FILES docker/debian/voxeld.default
  DESTINATION ${defaults_destination} RENAME voxeld COMPONENT server)

include(CPack)
