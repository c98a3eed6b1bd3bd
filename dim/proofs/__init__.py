"""What is proved about DIM: the decision over all cases, the protocol over all states."""
