"""Write the reference outputs anew: on purpose only, by ``make reference``.

What differs from the old ones is reported; why is then to be said in the commit that changes them.
"""

import mesoslip
from mesoslip.output import writing
from reference import CASES, FOLDER, report

if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, case in CASES.items():
        path, tree = FOLDER / f"{name}.nc", case()
        printed = (
            report(name, mesoslip.open_output(path), tree) if path.exists() else f"{name}: new"
        )
        print(printed or f"{name}: as it was")
        if printed:
            writing.write(tree, path)
    for path in sorted(FOLDER.glob("*.nc")):
        if path.stem not in CASES and path.stem != "old":
            print(f"{path.stem}: not a case any more; remove {path}")
