"""Recordings: the motion of a repetition with all that is needed to draw it, and files for others.

`trace` keeps one as a `.npz` file that needs neither the task's code nor the robot's files,
`figure` says what the robot looks like, `bag` writes a trace as a rosbag2 folder.
"""
