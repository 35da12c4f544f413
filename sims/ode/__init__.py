"""ODE, the engine inside Webots and Gazebo classic."""
