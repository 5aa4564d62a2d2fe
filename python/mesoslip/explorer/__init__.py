"""The explorer: a page on which a person turns knobs and sees the motion change.

`controls` says what can be changed, `session` holds what was changed, `following` runs it, and
`pictures` makes numbers to draw of it. None of them knows the page, which is `view`, served by
`server`.
"""
