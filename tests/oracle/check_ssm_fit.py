# check_ssm_fit.py SDMGEN: from meshes to a fit. Twenty meshes like a femur become a shape model, a short training a network of it, and the
# fit of that network to a test image gives back the weights of the image, each within 0.5 standard deviations of the population.
# Tests: cmd_import.c ssm_meshes.c
import json
import math
import os
import random

from sdm_program import done

chance = random.Random(3)
AROUND, ALONG = 16, 36


def femur(length, bow, neck, thick):
    """A bent tube with a thick lower end and, at the upper end, a neck to the side with a round head."""
    points = []
    for i in range(ALONG):
        s = i / (ALONG - 1)
        up = min(s / 0.8, 1.0)
        side = max(s - 0.8, 0.0) / 0.2
        centre = (bow * math.sin(math.pi * up) + neck * side, 0.0, length * up + 0.5 * neck * side)
        tilt = 0.9 * min(max((s - 0.72) / 0.16, 0.0), 1.0)
        low, head = math.exp(-((s / 0.12) ** 2)), math.exp(-(((s - 0.97) / 0.05) ** 2))
        radius = thick * (1 + 0.9 * low + 0.9 * head) * math.sqrt(max(1 - (2 * s - 1) ** 20, 0.02))
        for k in range(AROUND):
            a = 2 * math.pi * k / AROUND
            x, y = radius * math.cos(a), radius * math.sin(a)
            points.append((centre[0] + x * math.cos(tilt), centre[1] + y, centre[2] - x * math.sin(tilt)))
    for ring in (0, ALONG - 1):
        at = [points[ring * AROUND + k] for k in range(AROUND)]
        points.append(tuple(sum(c) / AROUND for c in zip(*at)))
    return points


def triangles():
    tri = []
    for k in range(AROUND):
        n = (k + 1) % AROUND
        tri.append((AROUND * ALONG, n, k))
        tri.append((AROUND * ALONG + 1, (ALONG - 1) * AROUND + k, (ALONG - 1) * AROUND + n))
        for i in range(ALONG - 1):
            a, b, c, d = i * AROUND + k, i * AROUND + n, (i + 1) * AROUND + k, (i + 1) * AROUND + n
            tri += [(a, b, c), (b, d, c)]
    return tri


os.mkdir("bones")
for i in range(20):
    shape = femur(60 + 4 * chance.gauss(0, 1), 4 + chance.gauss(0, 1), 14 + 1.5 * chance.gauss(0, 1), 4 + 0.3 * chance.gauss(0, 1))
    with open(f"bones/{i:02d}.off", "w") as f:
        f.write(f"OFF\n{len(shape)} {len(triangles())} 0\n")
        f.writelines("%r %r %r\n" % p for p in shape)
        f.writelines("3 %d %d %d\n" % t for t in triangles())

report = json.loads(done("import", "ssm", "bones", "-o", "femur.ssm", "--variance", "0.98", "--json"))
assert 2 <= report["modes"] <= 5, report
names = [f"m{i + 1}" for i in range(report["modes"])]
done("shapes", "check", "statistical", "-O", "model=femur.ssm")

with open("femur.yaml", "w") as f:
    f.write("shape: {name: statistical, options: {model: femur.ssm, limit: 2.5}}\ngrid: {spacing: 1.5}\n"
            "network: {kind: pod, modes: 64, width: 64, depth: 2}\ndata: {start: 256, online: 128}\ntrain: {minutes: 0.5}\nseed: 5\n")
done("train", "femur.yaml", "--out", "run", "--quiet")

truth = [1.2, -0.8, 0.5, -0.3, 0.6][: len(names)]
given = [a for name, w in zip(names, truth) for a in ("-p", f"{name}={w}")]
done("phantom", "--shape", "statistical", "-O", "model=femur.ssm", *given, "--spacing", "1.5", "--seed", "2", "-o", "ct.nii.gz", "--quiet")
result = json.loads(done("fit", "run/model.sdm", "ct.nii.gz", "--start-centre", "5,0,30", "--rotation", "0,0,0", "--polish", "--json", "--quiet"))
print(json.dumps({k: result[k] for k in result if k.startswith("parameters") or k == "trusted"}))
for name, w in zip(names, truth):
    estimate, sd = result["parameters"][name], result["parameters_sd"][name]
    assert abs(estimate - w) <= 0.5 and sd < 0.5, (name, w, estimate, sd)
