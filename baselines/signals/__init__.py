"""Traffic signals: fixed-time, adaptive, actuated and max-pressure."""
