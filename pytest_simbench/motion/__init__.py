"""The Panda: model, inverse kinematics, collision checking, motion planning, timing."""
