"""Laboratory: the commands of `python -m solver`, from images to tables, pictures and reports.

Commands: `command_line` has solve, demo, warm, board, snap and check; learn, rigidity,
outline, photos and trace are in `learn_command`, `rigidity_command`, `outline_command`,
`photos_command` and `trace_command`. `options` are those that several share, and the inputs that
they open; `help` words them, `console` is the terminal, `writing` writes files, and `command_end`
ends a command with a sentence and a status.

Images: `shots` is the interface of all sources and has that of files; `capture` has videos, films
and cameras, `controls` the settings of a camera, and `sources` opens what a command line names.

Estimates: `live` solves shots as they arrive; `table` has the columns and rows of the estimates,
`overlay` the pictures; `photos_table` and `photos_page` have the answers for photographs.

Checks: `findings` and `file_findings` compare a rig with its images and files, and `check` reports
on its calibration, with the `error_budget` of a usual push. `protocol` is a set with known loads,
`protocol_score` compares it with its estimates, and `protocol_report` reports on both.

Rigs: `target` draws a board to print, `saved_rig` keeps a calibrated rig, and `example` is one.
"""
