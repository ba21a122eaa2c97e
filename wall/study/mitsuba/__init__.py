"""Images held against Mitsuba 3's of the same scene."""
