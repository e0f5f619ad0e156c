import gzip
import hashlib
import pickle
import zipfile
from collections import Counter

import numpy as np
import pytest

from heatwalk import MeshError
from studies.datasets import DatasetError
from studies.datasets.bundled import Bundled
from studies.datasets.psb import CATEGORIES, NON_RIGID, PSB


@pytest.fixture
def small(tmp_path):
    """A benchmark of three small models, the second one damaged; only the first has segmentations by people."""
    off = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    data = tmp_path / "MeshsegBenchmark-1.0" / "data"
    people = data / "seg" / "Benchmark" / "2"
    people.mkdir(parents=True)
    (data / "off").mkdir()
    for name, text in (("2", off), ("10", off[:-8]), ("84", off), ("270", off), ("readme", "")):
        (data / "off" / f"{name}.off").write_text(text)
    for person in (0, 2, 10):
        (people / f"2_{person}.seg").write_text(f"0\n0\n0\n{person}\n")
    return tmp_path


def as_zip(folder, path):
    files = list(folder.rglob("*"))  # before the archive, which may be in the folder
    with zipfile.ZipFile(path, "w") as archive:
        for file in files:
            archive.write(file, file.relative_to(folder))
    return path


def test_the_zip_and_the_folder_contain_the_same_models(psb_zip, psb_root):
    packed, unpacked = PSB(psb_zip).models(), PSB(psb_root).models()
    assert [(model.name, model.category) for model in packed] == [(model.name, model.category) for model in unpacked]
    for here, there in zip(packed[::20], unpacked[::20], strict=True):
        assert here.digest() == there.digest()
        assert np.array_equal(here.load().vertices, there.load().vertices)
        assert np.array_equal(here.load().faces, there.load().faces)
        for ours, theirs in zip(here.human_segmentations(), there.human_segmentations(), strict=True):
            assert np.array_equal(ours, theirs)


def test_a_digest_is_the_hash_of_the_file(psb_root):
    models = PSB(psb_root).models()
    assert len(models) == 190
    for model in models:
        file = psb_root / "data" / "off" / f"{model.name}.off"
        assert model.digest() == hashlib.sha256(file.read_bytes()).hexdigest()


def test_an_archive_that_has_been_replaced_is_read_again(small, tmp_path):
    archive = as_zip(small, tmp_path / "small.zip")
    assert PSB(archive, models=[2]).models()[0].load().vertices[1].tolist() == [1, 0, 0]
    file = small / "MeshsegBenchmark-1.0" / "data" / "off" / "2.off"
    file.write_text(file.read_text().replace("1 0 0", "5 0 0"))
    archive.unlink()
    (model,) = PSB(as_zip(small, archive), models=[2]).models()
    assert model.load().vertices[1].tolist() == [5, 0, 0]
    assert model.digest() == hashlib.sha256(file.read_bytes()).hexdigest()


def test_human_segmentations_label_every_face(psb_zip):
    for model in PSB(psb_zip, models=[3, 25, 104, 390]).models():
        people = model.human_segmentations()
        assert len(people) >= 10
        assert {len(labels) for labels in people} == {len(model.load().faces)}


def test_human_segmentations_are_in_the_order_of_their_numbers(small):
    [model] = PSB(small, models=[2]).models()
    assert [labels[-1] for labels in model.human_segmentations()] == [0, 2, 10]


def test_a_model_without_segmentation_files_has_no_human_segmentations(small):
    [model] = PSB(small, models=[84]).models()
    assert model.human_segmentations() == []


def test_models_are_in_the_order_of_their_numbers(small, psb_zip):
    assert [model.name for model in PSB(small).models()] == ["2", "10", "84"]
    numbers = [int(model.name) for model in PSB(psb_zip).models()]
    assert numbers == sorted(numbers)


def test_the_root_may_be_any_of_the_benchmarks_folders_or_its_zip(small, tmp_path_factory):
    top = small / "MeshsegBenchmark-1.0"
    elsewhere = tmp_path_factory.mktemp("zips")
    roots = [small, top, top / "data"]
    roots += [as_zip(root, elsewhere / f"{i}.zip") for i, root in enumerate(roots)]
    found = [[(model.name, model.category, model.digest()) for model in PSB(str(root)).models()] for root in roots]
    assert all(models == found[0] for models in found)


def test_categories_are_as_the_benchmark_numbers_them(psb_zip):
    there = PSB(psb_zip).models()
    assert {model.category for model in there} == set(CATEGORIES)
    assert all(int(model.name) in CATEGORIES[model.category] for model in there)
    assert sum(map(len, CATEGORIES.values())) == 380
    assert len(NON_RIGID) == 11
    assert set(NON_RIGID) < set(CATEGORIES)


def test_categories_are_found_in_upper_and_lower_case(psb_zip):
    models = PSB(psb_zip, categories=["fourleg", "HUMAN"]).models()
    assert [int(model.name) for model in models] == [*range(1, 11), *range(381, 391)]


def test_models_may_be_numbers_or_names(psb_zip):
    assert PSB(psb_zip, models=[106, "1"]).models() == PSB(psb_zip, models=["106", 1]).models()


def test_categories_and_models_together_select_what_satisfies_both(psb_zip):
    models = PSB(psb_zip, categories=["Human", "Ant"], models=[3, 84, 106]).models()
    assert [model.name for model in models] == ["3", "84"]


def test_models_are_small_to_pickle_and_load_the_same_elsewhere(psb_zip):
    [model] = PSB(psb_zip, models=[81]).models()
    sent = pickle.dumps(model)
    assert len(sent) < 1000
    assert np.array_equal(pickle.loads(sent).load().vertices, model.load().vertices)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"categories": ["Humen"]}, "no category 'Humen'; did you mean Human?"),
        ({"categories": ["Spring"]}, "no category 'Spring'; .*It has Human, Cup, "),
        ({"categories": ["Human", "Cup"]}, "does not have the categories Cup; it has Human, Ant$"),
        ({"models": [2, 94]}, "does not have the models 94; it has 2, 10, 84$"),
        ({"models": [270]}, "does not have the models 270;"),
        ({"models": [2], "categories": ["Ant"]}, "has 3 models of the benchmark, and .* select none of them"),
        ({"models": []}, "select none of them"),
    ],
)
def test_a_request_for_what_is_not_available_is_an_error_that_lists_what_is(small, options, message):
    with pytest.raises(DatasetError, match=message):
        PSB(small, **options).models()


@pytest.mark.parametrize("options", [{"categories": "Human"}, {"models": 94}])
def test_an_option_that_is_not_a_list_is_an_error_that_shows_one(options):
    [(name, value)] = options.items()
    with pytest.raises(DatasetError, match=rf"'dataset.{name}=\[{value}\]'"):
        PSB("anywhere", **options)


def test_consecutive_numbers_of_models_are_listed_as_ranges(psb_zip):
    with pytest.raises(DatasetError, match=r"does not have the models 11; it has 1-10, 21-30, .*, 381-390$"):
        PSB(psb_zip, models=[11]).models()


def test_a_missing_benchmark_is_an_error_that_tells_where_to_get_it_and_what_to_type(tmp_path):
    (tmp_path / "not a zip.zip").write_text("nothing")
    as_zip(tmp_path, tmp_path / "other.zip")
    for root in (
        None,
        "",
        tmp_path / "nowhere",
        tmp_path,
        tmp_path / "not a zip.zip",
        tmp_path / "other.zip",
    ):
        with pytest.raises(DatasetError) as error:
            PSB(root).models()
        for part in (
            "https://segeval.cs.princeton.edu",
            "data/off/1.off",
            "dataset.root=PATH",
            "PSB_ROOT",
            str(root or ""),
        ):
            assert part in str(error.value)


@pytest.mark.parametrize("packed", [False, True])
def test_a_damaged_mesh_is_an_error_that_names_its_file(small, packed):
    root = as_zip(small, small / "psb.zip") if packed else small
    [model] = PSB(root, models=[10]).models()
    with pytest.raises(MeshError, match=r"MeshsegBenchmark-1\.0/data/off/10\.off: ") as error:
        model.load()
    assert str(error.value).startswith(str(root))


@pytest.mark.parametrize("packed", [False, True])
def test_suffixes_in_upper_case_are_found_and_files_of_macos_passed_over(small, packed):
    data = small / "MeshsegBenchmark-1.0" / "data"
    (data / "off" / "2.off").rename(data / "off" / "2.OFF")
    people = data / "seg" / "Benchmark" / "2"
    (people / "2_0.seg").rename(people / "2_0.SEG")
    (people / "2_2.seg").write_bytes(b"\xef\xbb\xbf0\r\n0\r\n0\r\n2\r\n")
    for name in ("seg/Benchmark/2/._2_0.SEG", "seg/Benchmark/2/._2_2.seg", "off/._2.off", "off/._84.off"):
        (data / name).write_bytes(b"\0\5\x16\7")
    copy = small / "__MACOSX" / "MeshsegBenchmark-1.0" / "data" / "off"
    copy.mkdir(parents=True)
    (copy / "._2.OFF").write_bytes(b"\0\5\x16\7")
    models = PSB(as_zip(small, small / "psb.zip") if packed else small).models()
    assert [model.name for model in models] == ["2", "10", "84"]
    assert len(models[0].load().faces) == 4
    assert [labels.tolist() for labels in models[0].human_segmentations()] == [
        [0, 0, 0, 0],
        [0, 0, 0, 2],
        [0, 0, 0, 10],
    ]
    assert models[0].digest() == hashlib.sha256((data / "off" / "2.OFF").read_bytes()).hexdigest()


def test_welded_models_keep_their_faces_and_have_another_digest(small):
    off = "OFF\n5 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n3 0 2 1\n3 0 1 3\n3 4 3 2\n3 1 2 3\n"
    (small / "MeshsegBenchmark-1.0" / "data" / "off" / "2.off").write_text(off)
    plain, welded = (PSB(small, models=[2], weld=weld).models()[0] for weld in (None, "exact"))
    assert len(plain.load().vertices) == 5
    assert welded.load().faces.tolist() == [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    assert plain.digest() == hashlib.sha256(off.encode()).hexdigest() != welded.digest()
    with pytest.raises(DatasetError, match=r"^dataset.weld=2 must be 'exact'"):
        PSB(small, weld=2)


@pytest.mark.parametrize("packed", [False, True])
def test_compressed_models_are_found_and_two_files_of_one_model_refused(small, packed):
    off = next(small.rglob("2.off"))
    (off.parent / "2.OFF.gz").write_bytes(gzip.compress(off.read_bytes()))
    off.unlink()
    root = as_zip(small, small.with_suffix(".zip")) if packed else small
    model = PSB(root, models=[2]).models()[0]
    assert len(model.load().faces) == 4
    assert model.digest() == hashlib.sha256((off.parent / "2.OFF.gz").read_bytes()).hexdigest()
    (off.parent / "2.obj").touch()
    with pytest.raises(DatasetError, match=r"has model 2 both as 2\.OFF\.gz and as 2\.obj; keep one of them"):
        PSB(small).models()


@pytest.fixture
def small_with_methods(small):
    """As `small`, with segmentations of model 2 by two methods, one with a folder per model, and of none by a third."""
    segmentations = small / "MeshsegBenchmark-1.0" / "data" / "seg"
    texts = {"RandCuts/2.seg": "0\n1\n1\n0\n", "KMeans/2/2_0.seg": "3\n1\n1\n0\n", "FitPrim/10.seg": "0\n"}
    for name, text in (texts | {"._KMeans/2.seg": "macOS", "KMeans/2/._2_0.seg": "macOS"}).items():
        file = segmentations / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    (segmentations / "readme.txt").write_text("by the authors")
    return small


@pytest.mark.parametrize("packed", [False, True])
def test_segmentations_by_methods_are_found_beside_those_by_people(small_with_methods, packed, tmp_path):
    root = as_zip(small_with_methods, tmp_path / "small.zip") if packed else small_with_methods
    models = {model.name: model for model in PSB(root).models()}
    expected = {"KMeans": "3\n1\n1\n0\n", "RandCuts": "0\n1\n1\n0\n"}
    assert models["2"].method_digests() == {
        name: hashlib.sha256(text.encode()).hexdigest() for name, text in expected.items()
    }
    for method, text in expected.items():
        assert models["2"].method_segmentation(method).tolist() == list(map(int, text.split()))
    assert list(models["10"].method_digests()) == ["FitPrim"]
    assert models["84"].method_digests() == {}


def test_several_segmentations_by_a_method_are_not_chosen_from(small_with_methods):
    folder = small_with_methods / "MeshsegBenchmark-1.0" / "data" / "seg" / "KMeans" / "2"
    (folder / "2_1.seg").write_text("0\n0\n0\n0\n")
    (model,) = PSB(small_with_methods, models=[2]).models()
    with pytest.raises(ValueError, match=r"^KMeans has 2 segmentations of model 2; one is expected$"):
        model.method_segmentation("KMeans")


def test_a_benchmark_without_other_folders_has_no_segmentations_by_methods(small, psb_zip):
    for root in (small, psb_zip):
        assert PSB(root, models=[2]).models()[0].method_digests() == {}
    with pytest.raises(ValueError, match="RandCuts has 0 segmentations of model 2"):
        PSB(small, models=[2]).models()[0].method_segmentation("RandCuts")


def test_a_model_of_another_dataset_has_no_segmentations_by_methods():
    model = Bundled(["cow"]).models()[0]
    assert model.method_digests() == {}
    with pytest.raises(ValueError, match="model cow has no segmentation by RandCuts"):
        model.method_segmentation("RandCuts")


def test_the_typical_number_of_segments_is_the_mode_over_the_people_and_models_of_the_category(psb_root):
    for category in ("Human", "Octopus"):
        numbers = Counter(
            len(np.unique(np.loadtxt(file, dtype=int)))
            for number in CATEGORIES[category]
            for file in (psb_root / "data" / "seg" / "Benchmark" / str(number)).glob("*.seg")
        )
        mode = min(number for number, count in numbers.items() if count == max(numbers.values()))
        first = next(str(n) for n in CATEGORIES[category] if (psb_root / "data" / "off" / f"{n}.off").exists())
        (model,) = PSB(psb_root, models=[first]).models()
        assert model.typical_n_segments() == mode


def test_a_category_that_nobody_segmented_has_no_typical_number(small):
    models = {model.name: model.typical_n_segments() for model in PSB(small).models()}
    # 2 and 10 are of one category, in which one person found a single segment, and two found two.
    assert models == {"2": 2, "10": 2, "84": None}
