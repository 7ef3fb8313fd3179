"""Tasks, their splits and setting, outcome and reward, messages and language."""
