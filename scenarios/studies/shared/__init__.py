"""What studies share: points, results, and the comparison with the paper."""
