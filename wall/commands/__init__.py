"""Commands beside `wall run`: render, screenshot, identify, check, draw."""
