"""The code of docs/python.md runs as it stands."""

import re
import shutil

import pytest
from conftest import SOURCE


def test_the_page(model_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs/cochlea").mkdir(parents=True)
    shutil.copy(model_file, tmp_path / "runs/cochlea/model.sdm")
    blocks = re.findall(r"^```python\n(.*?)^```", (SOURCE / "docs/python.md").read_text(), re.M | re.S)
    assert len(blocks) == 5
    names = {}
    for block in blocks:
        if "import torch" in block:
            pytest.importorskip("torch")
        exec(compile(block, "docs/python.md", "exec"), names)
    assert (tmp_path / "cochlea.stl").exists() and (tmp_path / "cochlea.nii.gz").exists()
    assert names["result"].params.shape == (2,)
