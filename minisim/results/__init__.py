"""What a run leaves: trips, metrics, trajectories and how safe it was."""
