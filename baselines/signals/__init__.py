"""Traffic signals: fixed-time, adaptive, actuated and longest-queue."""
