"""Detections to a calibration: the robust start with OpenCV, the float64 finish, covariance and the first gates."""
