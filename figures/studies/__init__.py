"""Figures and tables of the studies, one module a study, which exports its `SECTION`."""
