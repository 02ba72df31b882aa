# The ROS side of the package: messages, catkin export, and helpers for what links roscpp.
# Debian's interpreter has catkin_pkg and the ROS modules; another python3 may stand first on PATH.
set(PYTHON_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "The interpreter that has catkin_pkg")
set(Python3_EXECUTABLE ${PYTHON_EXECUTABLE} CACHE FILEPATH "The same for ament's packages")
# find_package(catkin) notes down, once, which folders of the devel space the tests' environment shall
# have, and leaves out those that do not exist yet: the messages' Python modules would be missing.
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/devel/lib/python3/dist-packages)
# Nothing here speaks Lisp.
set(ENV{ROS_LANG_DISABLE} genlisp)
find_package(catkin REQUIRED COMPONENTS
  camera_info_manager cv_bridge diagnostic_msgs diagnostic_updater geometry_msgs image_transport
  message_filters message_generation nav_msgs nodelet pcl_conversions pluginlib rosbag roscpp
  sensor_msgs std_msgs std_srvs tf2 tf2_eigen tf2_ros visualization_msgs)
if(LIVEMAP_DEVELOPMENT)
  find_package(rostest REQUIRED)
endif()

file(GLOB message_files RELATIVE ${PROJECT_SOURCE_DIR}/msg CONFIGURE_DEPENDS msg/*.msg)
add_message_files(FILES ${message_files})
generate_messages(DEPENDENCIES geometry_msgs sensor_msgs std_msgs)
catkin_package(CATKIN_DEPENDS message_runtime geometry_msgs sensor_msgs std_msgs)

# Everything ROS as one interface target, its headers as system headers so that our warnings stay ours.
add_library(livemap_catkin INTERFACE)
target_include_directories(livemap_catkin SYSTEM INTERFACE
  ${catkin_INCLUDE_DIRS} ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_INCLUDE_DESTINATION})
target_link_libraries(livemap_catkin INTERFACE ${catkin_LIBRARIES})
add_dependencies(livemap_catkin livemap_generate_messages_cpp)

install(DIRECTORY launch config rviz web models rosbags
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(DIRECTORY scripts/ USE_SOURCE_PERMISSIONS
  DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION} PATTERN "__pycache__" EXCLUDE)
# The one script that is a node. Among a built package's programs roslaunch finds it there, else twice: in scripts/ and,
# where that lies below the sources, in the install space.
file(MAKE_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})
file(CREATE_LINK ${PROJECT_SOURCE_DIR}/scripts/livemap_player
  ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION}/livemap_player SYMBOLIC)
install(FILES nodelet_plugins.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
