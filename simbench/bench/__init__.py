"""Who can be trusted? Grids of scenarios simulated with their truth, judged by detectors, scored, compared, defended.

What the command line and the report call (paths are str or Path; each raises `UserError` in one sentence):

- `execute.run.run_grid(grid, out, methods=("fast",), jobs=1, *, raw=False, plugins=(), backend="loky", address=None,
  resume=False, until_width=None, sets={}, axes={}, thresholds=None, keep=0, progress=None) -> Path`: the run's folder.
  `grid` is a name or a file; `sets` {"seed": 3, "controller.Kc": 2}, `axes` {"S_over_2J": [0.5, 1]}. Ctrl-C raises
  `run.Interrupted` (a KeyboardInterrupt whose text says how to resume).
- `score.scoring.score_run(folder, raw=False) -> Scores`: `.table`, `.by_axis`, `.disagreement` (DataFrames), `.as_text()`,
  `.as_json()`.
- `score.check.check_run(folder, against) -> Check`: `.failed` (exit 1), `.as_text()`, `.as_markdown()`, `.as_junit()`,
  `.as_json()`; `check.update_baseline(folder, baseline) -> str`: the readable difference.
- `score.compare.compare(folder, other=None) -> Comparison`: paired tests between detectors, or between two runs.
- `calibrate.calibrate(grid, false_alarm, methods=("fast",), jobs=1, out=None) -> Calibration`: `.as_text()`,
  `.as_json()`, `.roc`.
- `worst.worst(method, budget=2000, seed=0) -> Worst`: `.loop`, `.seed`, `.score`, `.as_text()`, `.to_toml()`.
- `store.reading.read_scenario(folder, scenario_id) -> Scenario`, `store.reading.RunArrays.read(folder)`: tables as arrays.
- `execute.sweep.sweep(loop, axes, seeds=1).score(detectors) -> DataFrame`.
"""
