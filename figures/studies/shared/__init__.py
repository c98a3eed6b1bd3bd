"""What the figures of studies share: how a section is put together, and what plots look like."""
