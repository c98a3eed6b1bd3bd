"""Figures and tables of the studies, one module per study, which exports its `SECTION`."""
