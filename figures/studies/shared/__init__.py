"""What the studies' figures share: how a section is put together and what plots look like."""
