"""CoppeliaSim, with the physics engines that it brings."""
