"""What is proved of DIM: the decision over all cases, the protocol over all states."""
