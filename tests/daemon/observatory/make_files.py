"""Small files in the shape of four projects, for tests: DESI, SDSS-V, PFS and MOONS.

make(project, folder, count, seed) writes a focal plane of some `count` robots with broken ones among
them, a configuration that can be reached, and measured moves where the project has a form for them.
The numbers are made here; only names of columns and forms of files are the projects' own.
"""

import csv
import math
import random

import numpy
from astropy.io import fits
from astropy.table import Table


def hexagon(count, pitch):
    """Places on a hexagonal lattice, nearest the centre first."""
    reach = int(math.sqrt(count)) + 2
    places = [((a + b / 2) * pitch, b * pitch * math.sqrt(3) / 2)
              for a in range(-2 * reach, 2 * reach) for b in range(-reach, reach + 1)]
    return sorted(places, key=lambda p: (round(math.hypot(*p), 6), math.atan2(p[1], p[0])))[:count]


def fibre(base, arms, theta, phi):
    """Where the fibre is; angles in degrees, zeros included."""
    t, p = math.radians(theta), math.radians(theta + phi)
    return (base[0] + arms[0] * math.cos(t) + arms[1] * math.cos(p),
            base[1] + arms[0] * math.sin(t) + arms[1] * math.sin(p))


def write_csv(path, rows, **kwargs):
    with open(path, "w", newline="") as out:
        writer = csv.DictWriter(out, list(rows[0]), **kwargs)
        writer.writeheader()
        writer.writerows(rows)


def desi(folder, count, seed):
    rng = random.Random(seed)
    calib, assign, moves, state = [], [], [], []
    on_petal = {}
    for k, (x, y) in enumerate(hexagon(count, 10.4)):
        petal = (3 + int((math.degrees(math.atan2(y, x)) % 360) // 36)) % 10
        device = on_petal[petal] = on_petal.get(petal, 0) + 1
        turn = (petal + 7) % 10 * 36
        arms = rng.gauss(3, 0.03), rng.gauss(3, 0.03)
        zero_t, zero_p = rng.uniform(-180, 180), rng.gauss(5, 5)
        broken = k % 9 == 4
        cut = k % 13 == 7
        calib.append({
            "pos_id": f"M{1000 + k:05d}", "petal_id": petal + 2, "device_loc": device,
            "time_recorded": "2026-03-03 04:00:00.000000+00:00", "bus_id": f"can{10 + petal}",
            "length_r1": repr(arms[0]), "length_r2": repr(arms[1]),
            "offset_x_cs5": repr(x), "offset_y_cs5": repr(y), "offset_t": repr(zero_t - turn),
            "offset_p": repr(zero_p), "physical_range_t": 391.2, "physical_range_p": 190.5,
            "calib_note": 'scale, set by hand; params {"GEAR_CALIB_T": 1.0}',
            "fiber_intact": not cut, "device_classified_nonfunctional": broken, "petal_loc": petal})
        # Targets within half a pitch are clear of each other whatever the neighbours do.
        theta, phi = rng.uniform(-170, 170), rng.uniform(150, 170)
        tx, ty = fibre((x, y), arms, theta + zero_t, phi + zero_p)
        assign.append((petal * 1000 + device, 5000 + k, "POS", 39627 * 10**12 + k if k % 11 else -k - 1,
                       tx, ty))
        state.append({"pos_id": f"M{1000 + k:05d}", "pos_t": round(rng.uniform(-150, 150), 4),
                      "pos_p": round(rng.uniform(140, 160), 4)})
        if k < 5:
            at = [0.0, 150.0]
            for n in range(12):
                to = [rng.uniform(-150, 150), rng.uniform(120, 170)]
                mx, my = fibre((x, y), arms, to[0] + zero_t, to[1] + zero_p)
                seen = not (k == 2 and n == 5)
                moves.append({
                    "POS_ID": f"M{1000 + k:05d}", "EXPOSURE_ID": 96032 + n, "EXPOSURE_ITER": 0,
                    "TIME_RECORDED": f"2026-03-03T05:{n:02d}:{k:02d}.5+00:00", "POS_T": to[0],
                    "POS_P": to[1], "OBS_X": mx + rng.gauss(0, 0.002) if seen else "nan",
                    "OBS_Y": my + rng.gauss(0, 0.002) if seen else "nan", "FLAGS": 4,
                    "CTRL_ENABLED": True, "LOG_NOTE": f"req_posintTP=({to[0]}, {to[1]}); blind"})
                at = to
    write_csv(f"{folder}/calib.csv", calib)
    write_csv(f"{folder}/posstate.csv", state)
    rng.shuffle(moves)
    write_csv(f"{folder}/posmoves.csv", moves)
    table = Table(rows=assign, names=("LOCATION", "FIBER", "DEVICE_TYPE", "TARGETID", "FIBERASSIGN_X",
                                      "FIBERASSIGN_Y"))
    table["FIBERASSIGN_X"].unit = table["FIBERASSIGN_Y"].unit = "mm"
    table["LAMBDA_REF"] = numpy.float32(5400)
    fits.HDUList([fits.PrimaryHDU(), fits.BinTableHDU(table, name="FIBERASSIGN"),
                  fits.BinTableHDU(Table({"TARGETID": [1], "RA": [2.0]}), name="TARGETS")]).writeto(
                      f"{folder}/fiberassign.fits.gz", overwrite=True)


def sdss(folder, count, seed):
    rng = random.Random(seed)
    table, holes, rows, angles, measured, off = [], [], [], [], [], []
    places = hexagon(count, 22.4)
    for k, (x, y) in enumerate(places):
        hole = f"R{k // 20:+d}C{k % 20}"
        holes.append({"": k, "site": "APO", "holeID": hole, "holeType": "ApogeeBoss",
                      "xWok": repr(x), "yWok": repr(y), "zWok": 143.1, "ix": 0, "iy": -1, "iz": 0,
                      "jx": 1, "jy": 0, "jz": 0, "kx": 0, "ky": 0, "kz": 1})
        arm, met = rng.gauss(7.4, 0.01), (rng.gauss(14.314, 0.01), rng.gauss(0, 0.05))
        zero = rng.gauss(0, 0.3), rng.gauss(0, 0.3)
        table.append({"": k, "site": "APO", "positionerID": 3 + 2 * k, "wokID": "SloanFlatCMM",
                      "holeID": hole, "alphaArmLen": repr(arm), "metX": repr(met[0]),
                      "metY": repr(met[1]), "apX": 14.965, "apY": 0.376, "bossX": 14.965,
                      "bossY": -0.376, "alphaOffset": repr(zero[0]), "betaOffset": repr(zero[1]),
                      "dx": 0.01, "dy": -0.02})
        if k % 10 == 6:
            off.append({"positionerID": 3 + 2 * k, "reason": "beta motor does not move",
                        "theta_deg": 10, "phi_deg": 170})
        # The folded arm reaches 7 mm beyond the hole: clear of its neighbours at 22.4 mm.
        alpha, beta = rng.uniform(5, 355), rng.uniform(160, 178)
        lost = k % 17 == 5
        for kind in ("APOGEE", "BOSS", "METROLOGY"):
            is_it = kind == "BOSS" and k % 3 != 0
            rows.append(
                f"FIBERMAP {3 + 2 * k} {hole} {kind} {int(is_it)} 0 1 0 0.0 0.0 143.1 "
                f"{-999.0 if lost else alpha} {-999.0 if lost else beta} "
                f"{{-999.0 -999.0 -999.0 -999.0 -999.0}} \"{'science' if is_it else ''}\" "
                f"{27021597910082936 + k if is_it else -999}")
        angles.append((3 + 2 * k, 10.0, 170.0, alpha, beta, alpha + 1e-3, beta - 1e-3))
        base = x + 0.01, y - 0.02
        mx, my = fibre(base, (arm, math.hypot(*met)), alpha + zero[0] - 90,
                       beta + zero[1] + math.degrees(math.atan2(met[1], met[0])))
        measured.append((3 + 2 * k, mx, my, k % 19 == 3))
    write_csv(f"{folder}/positionerTable.csv", table)
    write_csv(f"{folder}/wokCoords.csv", holes)
    write_csv(f"{folder}/disabled.csv", off)
    write_csv(f"{folder}/fiducialCoords.csv",
              [{"": k, "site": "APO", "holeID": f"F{k}", "id": f"F{k}", "xWok": repr(x / 2 + 4),
                "yWok": repr(y / 2 + 11.2)} for k, (x, y) in enumerate(places[:6])])
    with open(f"{folder}/confSummary.par", "w") as out:
        out.write("#%yanny\n#\n# confSummary-1.par\nconfiguration_id 1\nobservatory APO\n\n"
                  "typedef enum {\n    BOSS,\n    APOGEE,\n    METROLOGY,\n    NONE\n} FIBERTYPE;\n\n"
                  "typedef struct {\n    short positionerId;\n    char holeId[28];\n"
                  "    FIBERTYPE fiberType;\n    short assigned;\n    short on_target;\n"
                  "    short valid;\n    short decollided;\n    double xwok;\n    double ywok;\n"
                  "    double zwok;\n    float alpha;\n    float beta;\n    float mag[5];\n"
                  "    char category[400];\n    long catalogid;\n} FIBERMAP;\n\n")
        out.write("\n".join(rows) + "\n")
    for n in (1, 2):
        a = Table(rows=angles, names=("positionerID", "startAlpha", "startBeta", "cmdAlpha", "cmdBeta",
                                      "alphaReport", "betaReport"))
        m = Table(rows=measured, names=("positionerID", "xWokMeasMetrology", "yWokMeasMetrology",
                                        "wokErrWarn"))
        primary = fits.PrimaryHDU()
        primary.header["DATE-OBS"] = f"2026-03-03T05:0{n}:00.0"
        fits.HDUList([primary, fits.BinTableHDU(a, name="POSANGLES"),
                      fits.BinTableHDU(m, name="POSITIONERTABLEMEAS")]).writeto(
                          f"{folder}/proc-fimg-{n}.fits", overwrite=True)


def pfs(folder, count, seed):
    rng = random.Random(seed)
    design, fibres, move, match = [], [], [], []
    places = hexagon(count, 8.0)
    modules = {}
    for k, (x, y) in enumerate(places):
        module, place = k // 57 + 1, k % 57 + 1
        arms = rng.gauss(2.375, 0.01), rng.gauss(2.375, 0.01)
        stop, inner = rng.uniform(0, 360), rng.uniform(-3, 3)
        outer = inner + rng.uniform(176, 180)
        status = 1 if k % 12 != 5 else rng.choice([0, 4, 8, 3])
        pixel = 0.09
        modules.setdefault(module, []).append(f"""  <ARM_DATA_CONTAINER>
    <DATA_HEADER>
      <Module_Id>{module}</Module_Id>
      <Positioner_Id>{place}</Positioner_Id>
      <Serial_Number>{4000 + k}</Serial_Number>
      <Status>{status}</Status>
      <Pixel_scale>90.0</Pixel_scale>
    </DATA_HEADER>
    <KINEMATICS>
      <Global_base_pos_x>{x / pixel!r}</Global_base_pos_x>
      <Global_base_pos_y>{y / pixel!r}</Global_base_pos_y>
      <Link1_Link_Length>{arms[0] / pixel!r}</Link1_Link_Length>
      <Link2_Link_Length>{arms[1] / pixel!r}</Link2_Link_Length>
      <CCW_Global_base_ori_z>{stop!r}</CCW_Global_base_ori_z>
      <CW_Global_base_ori_z>{(stop + 20) % 360!r}</CW_Global_base_ori_z>
      <Joint1_CCW_limit_angle>0</Joint1_CCW_limit_angle>
      <Joint1_CW_limit_angle>380</Joint1_CW_limit_angle>
      <Joint2_CCW_limit_angle>{inner!r}</Joint2_CCW_limit_angle>
      <Joint2_CW_limit_angle>{outer!r}</Joint2_CW_limit_angle>
    </KINEMATICS>
    <SLOW_CALIBRATION_TABLE>
      <Joint1_fwd_regions>3,0,0.0,3.6,7.2,</Joint1_fwd_regions>
    </SLOW_CALIBRATION_TABLE>
  </ARM_DATA_CONTAINER>
""")
        theta, phi = rng.uniform(10, 350), rng.uniform(5, 30)
        at = fibre((x, y), arms, theta + stop, phi + inner - 180)
        fibres.append({"cobraId": k + 1, "fiberId": 2604 - k, "scienceFiberId": k + 1})
        design.append((2604 - k, 100 + k, at if k % 8 else (math.nan, math.nan), 1 if k % 8 else 4,
                       1 if k % 20 != 9 else 2))
        for n in range(6 if k < 4 else 0):
            to = rng.uniform(0.2, 6), rng.uniform(0.1, 2)
            seen = fibre((x, y), arms, math.degrees(to[0]) + stop, math.degrees(to[1]) + inner - 180)
            key = {"pfs_visit_id": 1234, "iteration": n, "cobra_id": k + 1}
            move.append(key | {"motor_target_theta": to[0], "motor_target_phi": to[1],
                               "motor_num_step_theta": 100 * n})
            match.append(key | {"mcs_frame_id": 1234 * 100 + n, "spot_id": -1 if n == 3 else k,
                                "pfi_center_x_mm": seen[0], "pfi_center_y_mm": seen[1]})
    for module, cobras in modules.items():
        with open(f"{folder}/SC{module:02d}.xml", "w") as out:
            out.write('<?xml version="1.0" ?>\n<ARM_DATA>\n  <ARM_DATA_NAME>test</ARM_DATA_NAME>\n' +
                      "".join(cobras) + "</ARM_DATA>\n")
    write_csv(f"{folder}/fibres.csv", fibres)
    write_csv(f"{folder}/cobra_move.csv", move)
    write_csv(f"{folder}/cobra_match.csv", match)
    write_csv(f"{folder}/mcs_exposure.csv",
              [{"mcs_frame_id": 1234 * 100 + n, "taken_at": f"2026-03-03 05:0{n}:30", "altitude": 60,
                "insrot": 12.5, "mcs_m1_temperature": 4.5} for n in range(6)])
    table = Table({"fiberId": numpy.array([d[0] for d in design], "i4"),
                   "objId": numpy.array([d[1] for d in design], "i8"),
                   "pfiNominal": numpy.array([d[2] for d in design], "f4"),
                   "targetType": numpy.array([d[3] for d in design], "i4"),
                   "fiberStatus": numpy.array([d[4] for d in design], "i4"),
                   "patch": ["0,0"] * len(design)})
    fits.HDUList([fits.PrimaryHDU(), fits.BinTableHDU(table, name="DESIGN")]).writeto(
        f"{folder}/pfsDesign.fits", overwrite=True)


def moons(folder, count, seed):
    rng = random.Random(seed)
    places = hexagon(count, 25.26)
    text = ["PAF.HDR.START;                    # Start of PAF Header",
            'PAF.TYPE         "Configuration"; # Type of PAF', "PAF.HDR.END;", ""]
    common = {"LENGTH1": 8.0, "LENGTH2": 17.0, "WIDTH2": 4.0, "LOW1": -180.0, "HIGH1": 180.0,
              "DEF1": 0.0, "LOW2": -180.0, "HIGH2": 150.0, "DEF2": 0.0, "PSCALE": 1.718}
    text += [f"INS.POS.{key}   {value:.3f};  # common" for key, value in common.items()]
    targets = []

    def polar(x, y):
        return math.hypot(x, y), math.degrees(math.atan2(x, y)) % 360

    for k, (x, y) in enumerate(places):
        if k == 0:  # an acquisition camera in the middle
            text += ["INS.ACQ1.RFOCAL  0.00000;", "INS.ACQ1.THFOCAL 90.00000;",
                     "INS.ACQ1.FOV     20.00000;"]
            continue
        r, th = polar(x, y)
        fr, fth = polar(*fibre((x, y), (8, 17), 0, 180))
        text += [f"INS.POS{k}.RFOCAL  {r:.5f}; # R coordinate of positioner {k} centre (mm)",
                 f"INS.POS{k}.THFOCAL {th:.5f}; # THETA coordinate (deg)",
                 f"INS.POS{k}.ORIENT  0.00000;",
                 f'INS.POS{k}.LOCK    "{"T" if k % 14 == 3 else "F"}";',
                 f"INS.FIBRE{k}.RFOCAL  {fr:.5f};", f"INS.FIBRE{k}.THFOCAL {fth:.5f};",
                 f'INS.FIBRE{k}.HEALTH  "{"F" if k % 15 == 8 else "T"}";', ""]
        t = fibre((x, y), (8, 17), rng.uniform(-170, 170), 180 + rng.uniform(2, 15))
        tr, tth = polar(*t)
        targets.append(f"{k:3d} {tr:9.4f} {tth:9.4f} {rng.choice('LR')} {k % 3 + 1}")
    with open(f"{folder}/positioners.cfg", "w") as out:
        out.write("\n".join(text) + "\n")
    with open(f"{folder}/targets.txt", "w") as out:
        out.write("\n".join(targets) + "\n")


def make(project, folder, count, seed=1):
    globals()[project](folder, count, seed)


if __name__ == "__main__":
    import sys
    make(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]) if len(sys.argv) > 4 else 1)
