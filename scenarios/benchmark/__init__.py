"""The benchmark: a fixed set of scenarios on which every controller is measured and ranked."""
