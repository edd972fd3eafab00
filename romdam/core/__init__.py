"""Types that pass between rooms, and what every room may use."""
