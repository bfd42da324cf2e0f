"""Other ways of flying an accepted path, for comparison; interchangeable with the autopilot's."""
