"""What a report says, whatever draws it: computed once from a run's records. Importing this room
loads no statistics library and no planner."""
