"""What a run produces: trips, metrics, trajectories and how safe it was."""
