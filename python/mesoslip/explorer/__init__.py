"""The explorer: a page on which a person turns knobs and sees the motion change.

`controls` defines the knobs, `session` has the changes and the errors, `live_run` runs, and
`pictures` computes the numbers that are drawn, all independent of the page, which is `view`, served
by `server`.
"""
