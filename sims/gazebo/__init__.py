"""Gazebo (gz-sim), the simulator of ROS users."""
