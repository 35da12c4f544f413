"""What a report says, whatever draws it: computed once from a run's records.

`summary` makes rows of records. `answer`, `claims`, `truth`, `sweep`, `history`, `changes` and
`repeatability` make sentences and tables of them, which are `document`'s. Importing this room
loads no statistics library and no planner.
"""
