"""The player: a run as a scene, and the web page that plays it."""
