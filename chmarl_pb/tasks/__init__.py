"""Tasks: splits, set-up, outcome and reward, messages, feedback, language, and the planner that knows everything."""
