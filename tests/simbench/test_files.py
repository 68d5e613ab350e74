"""What is written stands whole under its name, on this machine, or not at all."""

import pytest

from simbench.files import FileError, folder, whole_file


@pytest.mark.parametrize("url", ["s3://bucket/run", "gs:/bucket/run", "memory://run", "file:///tmp/run"])
def test_an_unknown_scheme_is_refused_and_no_folder_is_made(url, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match="is unknown; give a path on this machine"):
        folder(url)
    with pytest.raises(FileError, match="is unknown"), whole_file(url):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["run", "a/b", "x:y", "2026-11-20T17:18"])
def test_a_colon_alone_is_no_scheme(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert folder(name).is_dir()
