"""How visual odometry is measured (scripts/odometry): flights and faults to measure with, and the
errors of a path and of a map.

- poses: trajectories and their readers (TUM, EuRoC, KITTI).
- alignment, errors: similarities, ATE, RPE, coverage, silent errors; equal to evo's.
- covariance, surfaces: stated against true errors of poses; points against a room's surfaces.
- sets, flights, faults: set folders, rendered flights (tools/flights), faults put into any set.
- runs, orbslam, vocabulary: the program `twoview odometry` and ORB-SLAM3 as processes.
- evaluate, targets, tables, cli: one run's figures, what they must reach, and the table.
"""
