"""What a run says of itself: RUN.json, what was left out, lost light, the plan as text."""
