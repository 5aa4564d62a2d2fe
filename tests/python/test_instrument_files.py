"""Files as instruments write them: each is a small made one in the form of its instrument."""

import mesoslip
import numpy as np
import pytest

TIME = np.arange(12) * 0.5
FORCE = 1.5 + 0.25 * (np.arange(12) % 3)
X = 0.01 * np.arange(12)
# Forces [N] at the times of the record, and the normal force [N].
LOAD = 20.0


def rows(*columns, form="{:.4f}", between="\t", decimal="."):
    """Lines of numbers."""
    lines = (between.join(form.format(one) for one in row) for row in zip(*columns, strict=True))
    text = "\n".join(lines) + "\n"
    return text.replace(".", decimal)


LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
    "Decimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tAbsolute\n"
    "Date\t2024/05/01\nTime\t12:00:00.1\n***End_of_Header***\t\n\nChannels\t1\t\nSamples\t12\t\n"
    "Date\t2024/05/01\t\nX_Dimension\tTime\t\nX0\t0.0\t\nDelta_X\t0.5\t\n***End_of_Header***\t\n"
    "X_Value\tForce (N)\tComment\n" + rows(TIME, FORCE).replace("\n", "\t\n")
)
TEKTRONIX = (
    "Model,MSO44\nFirmware Version,1.30\n\nWaveform Type,ANALOG\nHorizontal Units,s\n"
    "Sample Interval,0.5\nRecord Length,12\n\n\nTIME,CH1\n"
    + rows(TIME, FORCE, between=",", form="{:.5e}")
)
PICOSCOPE = "Time,Channel A\n(ms),(mV)\n\n" + rows(1e3 * TIME, 1e3 * FORCE, between=",")
KEYSIGHT = "x-axis,1\nsecond,Volt\n" + rows(TIME, FORCE, between=",", form="{:.6E}")
BLUEHILL = (
    '"Results Table 1"\n"","Friction"\n"","(N)"\n\n"Time","Extension","Load"\n'
    '"(s)","(mm)","(N)"\n' + "".join(
        f'"{a:.4f}","{b:.4f}","{c:.4f}"\n' for a, b, c in zip(TIME, X, FORCE, strict=True)
    )
)  # fmt: skip
TESTXPERT = "Prüfzeit;Standardweg;Standardkraft\ns;mm;N\n" + rows(
    TIME, X, FORCE, between=";", decimal=","
)
CATMAN = (
    "HBM_CATMAN_DATAFILE_40\t\nT0 =\t01.05.2024 12:00:00\nTime  1 - default sample rate [s]\t"
    "Friction force [N]\n" + rows(TIME, FORCE)
)
TRIBOMETER = (
    "Data file\tA.TSV\nConfiguration file\tA.CFG\n\nTest started at 16:10:03 on 2019-04-08\n"
    "Time\tTest Time\tLoad (N)\tFriction Force (N)\tFriction Coefficient\n"
    + "".join(
        f"16:10:{int(t):02d}\t{t:.1f}\t{LOAD}\t{f:.4f}\t{f / LOAD:.5f}\n".replace(".", ",")
        for t, f in zip(TIME, FORCE, strict=True)
    )
    + "Test completed at 16:20:17 on 2019-04-08\n"
)
UMT = "T[s],Fx[N],Fz[N],Z[mm],COF\n" + rows(TIME, FORCE, LOAD + 0 * X, X, FORCE / LOAD, between=",")
TRACTION = (
    "PCS Instruments\nProfile\tStribeck\n\nStep time (s)\tRolling Speed (mm/s)\t"
    "Traction force (N)\tBall load (N)\tTraction coeff (-)\n"
    + rows(TIME, 100 + X, FORCE, LOAD + 0 * X, FORCE / LOAD)
)
ROCK = "Time(s)\tDispl(microns)\tShear_stress(MPa)\tNormal_stress(MPa)\n" + rows(
    TIME, 1e3 * X, FORCE, LOAD + 0 * X
)
MARKED = "# run 1\nTime\tLP_Disp\tShear_Stress\tNormal_Stress\n#\tmicron\tMPa\tMPa\n" + rows(
    TIME, 1e3 * X, FORCE, LOAD + 0 * X
)
# 10 um in half a second.
SCANNED = "Piezo position (um)\tLateral force (N)\n" + rows(1e3 * X, FORCE)
MTS = (
    "MTS793|BTW|ENU|1|2|.|:|1|0|0|A\n\nData Acquisition: Timed\nStation Name: Shear.cfg\n\n"
    "Time\tShear Displacement\tShear Force\tNormal Force\nSec\tmm\tkN\tkN\n"
    + rows(TIME, X, 1e-3 * FORCE, 1e-3 * LOAD + 0 * X, form="{:.7f}")
)
DURATIONS = "Time\tStep Time\tTest Time\tSpeed\tFriction Force\tFriction Coefficient\n" + "".join(
    f"16:10:{int(t):02d}\t{30 if t < 4 else 3600}\t{t:.1f}\t65\t{f:.2f}\t{f / LOAD:.5f}\n"
    for t, f in zip(TIME, FORCE, strict=True)
)
DATED = "Date\tTime\tElapsed Time (s)\tCharge normale (N)\tFriction (N)\n" + "".join(
    f"04/03/2026\t16:10:{int(t):02d}\t{t:.1f}\t{LOAD}\t{f:.4f}\n"
    for t, f in zip(TIME, FORCE, strict=True)
)
TRIBOX = (
    "TRIBOX 4.5\r\nNormal load : 20.00 [N]\r\nFrequency : 0.25 [Hz]\r\n\r\n"
    "Time [s]\tAmplitude [mm]\tFt [N]\tµ\r\n" + rows(TIME, X, FORCE, FORCE / LOAD)
)
RTEC = "Rtec Instruments\nTest,A\n\nTimestamp,Step,Z Pos (mm),Fx (N),Fz (N),COF\n" + rows(
    TIME, 1 + 0 * X, X, FORCE, -LOAD + 0 * X, FORCE / LOAD, between=","
)
SRV = "Optimol SRV 5;;\nVersuch;17;\nZeit;Reibkraft;Weg\ns;N;mm\n" + rows(
    TIME, FORCE, X, between=";", decimal=","
)
DEWESOFT = (
    "Data\n\nStart time: 3/4/2026 14:05:07.000\nNumber of channels: 2\nSample rate: 2\n\n"
    "Time (s)\tF_t (N)\tF_n (N)\n" + rows(TIME, FORCE, LOAD + 0 * X)
)
TEXTS = {
    "Anton Paar": (TRIBOX, {}),
    "Rtec": (RTEC, {}),
    "Optimol SRV": (SRV, {}),
    "Dewesoft": (DEWESOFT, {}),
    "LabVIEW (.lvm)": (LABVIEW, {}),
    "LabVIEW without comments, with units": (
        LABVIEW.replace("\t\n", "\n")
        .replace("X_Dimension", "Y_Unit_Label\tN\t\nX_Dimension")
        .replace("Force (N)", "Force"),
        {},
    ),
    "duration of the step among the times": (DURATIONS, {}),
    "clock of whole seconds beside the elapsed time": (DATED, {}),
    "oscilloscope of Tektronix": (TEKTRONIX, {"columns": "time [s], force [N]"}),
    "PicoScope": (PICOSCOPE, {"columns": "time [ms], force [mN]"}),
    "oscilloscope of Keysight": (KEYSIGHT, {"columns": "time [s], force [N]"}),
    "Instron Bluehill": (BLUEHILL, {}),
    "Zwick testXpert": (TESTXPERT, {}),
    "HBM catman": (CATMAN, {}),
    "pin on disc (decimal commas, preamble)": (TRIBOMETER, {}),
    "Bruker UMT": (UMT, {}),
    "PCS traction machine": (TRACTION, {}),
    "double direct shear, marked units": (MARKED, {"area": "1 mm^2"}),
    "lateral force over a piezo's position": (SCANNED, {"velocity": "20 um/s"}),
    "double direct shear (BRAVA)": (ROCK, {"area": "1 mm^2"}),
    "MTS TestSuite": (MTS, {}),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_texts_of_instruments(name, tmp_path):
    """Forces and times as they were made, with the options that the page names."""
    text, options = TEXTS[name]
    path = tmp_path / "a.txt"
    path.write_text(text, encoding="utf-8")
    tree = mesoslip.read_trace(path, **options)
    name = "spring_force" if "spring_force" in tree else "friction_coefficient"
    scale = 1.0 if name == "spring_force" else LOAD
    assert scale * tree[name].values[0] == pytest.approx(FORCE, rel=1e-3)
    assert np.diff(tree["time"].values) == pytest.approx(np.full(11, 0.5), rel=1e-6)


def test_a_lone_load_cell_pulls(tmp_path):
    """As a lone load does; beside a friction force it presses."""
    time = np.arange(0, 6, 0.01)
    table = np.transpose([time, 5 * time, np.minimum(1, time % 3) + 1, 0 * time + 2])
    for names, quantity in (
        ("Time (s)\tStage (um)\tLoad cell (mN)", "spring_force"),
        ("Time (s)\tStage (um)\tFriction force (mN)\tLoad cell (mN)", "normal_force"),
        ("Time (s)\tNormal force (N)\tLoad cell (mN)", "spring_force"),
    ):
        path = tmp_path / f"{quantity}.txt"
        columns = table[:, : names.count("\t") + 1]
        np.savetxt(path, columns, delimiter="\t", header=names, comments="")
        tree = mesoslip.read_trace(path)
        assert "'Load cell (mN)' taken as" in tree.attrs["understood"]
        assert tree[quantity].values.ravel()[-1] == pytest.approx(1e-3 * columns[-1, -1])
