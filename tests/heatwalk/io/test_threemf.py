import io
import re
import zipfile

import numpy as np
import pytest

from heatwalk.io import read_mesh, threemf
from heatwalk.meshes import MeshError
from tests.helpers.mesh_files import TETRAHEDRON, is_mesh

VERTICES, FACES = TETRAHEDRON
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/{}"/></Relationships>'
)


def mesh_object(number, vertices=VERTICES, faces=FACES):
    rows = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in np.asarray(vertices).tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}" pid="1"/>' for a, b, c in faces)
    mesh = f"<mesh><vertices>{rows}</vertices><triangles>{triangles}</triangles></mesh>"
    return f'<object id="{number}" type="model">{mesh}</object>'


def components(number, *rows):
    return f'<object id="{number}"><components>{"".join(rows)}</components></object>'


def model(objects, build, unit=' unit="millimeter"'):
    return (
        f'<?xml version="1.0"?><model{unit} xmlns="{CORE}" xmlns:p="{PRODUCTION}"><resources>{objects}</resources>'
        f"<build>{build}</build></model>"
    )


def package(*models, main="3dmodel.model", relations=RELATIONS):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("_rels/.rels", relations.format(main))
        for name, text in models:
            archive.writestr(f"3D/{name}", text)
    return stream.getvalue()


def read(tmp_path, *models, **options):
    (tmp_path / "thing.3mf").write_bytes(package(*models, **options))
    return read_mesh(tmp_path / "thing.3mf")


def simple(build='<item objectid="1"/>', objects=None, **options):
    return "3dmodel.model", model(objects or mesh_object(1), build, **options)


@pytest.mark.parametrize(
    ("unit", "name"),
    [("", "millimetres"), (' unit="inch"', "inches"), (' unit="meter"', "metres"), (' unit="micron"', "micrometres")],
)
def test_an_object_is_read_in_the_unit_of_the_file_with_a_note(tmp_path, unit, name):
    mesh = read(tmp_path, simple(unit=unit))
    assert is_mesh(mesh, VERTICES, FACES)
    assert mesh.notes == (f"coordinates are in {name}",)


def test_transforms_of_items_and_components_are_applied_one_after_the_other(tmp_path):
    inner = '<component objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 20 30"/>'  # a quarter turn, and a shift
    item = '<item objectid="2" transform="2 0 0 0 2 0 0 0 2 1 1 1"/>'
    mesh = read(tmp_path, simple(item + '<item objectid="1"/>', mesh_object(1) + components(2, inner)))
    x, y, z = VERTICES.T
    moved = 2 * np.column_stack([10 - y, 20 + x, 30 + z]) + 1
    assert mesh.vertices == pytest.approx(np.vstack([moved, VERTICES]))
    assert mesh.notes == ("joined 2 parts of the scene", "coordinates are in millimetres")


def test_objects_in_other_models_are_each_read_once_where_they_are_referred_to(tmp_path):
    # As slicers write them: one model holds several objects, and the main model places them.
    other = VERTICES + 100
    parts = mesh_object(1) + mesh_object(2, other)
    rows = [
        f'<component p:path="/3D/Objects/parts.model" objectid="{n}" transform="1 0 0 0 1 0 0 0 1 {shift} 0 0"/>'
        for n, shift in ((1, 0), (2, 0), (1, 7))
    ]
    mesh = read(
        tmp_path,
        simple('<item objectid="9"/>', components(9, *rows)),
        ("Objects/parts.model", model(parts, "")),
    )
    assert np.array_equal(mesh.vertices, np.vstack([VERTICES, other, VERTICES + np.array([7, 0, 0])]))
    assert len(mesh.faces) == 12


def test_the_main_model_is_the_one_that_the_relations_name(tmp_path):
    other = ("a.model", model(mesh_object(1, VERTICES * 5), '<item objectid="1"/>'))
    assert is_mesh(read(tmp_path, other, ("z.model", simple()[1]), main="z.model"), VERTICES, FACES)
    assert is_mesh(read(tmp_path, simple(), relations="<none/>"), VERTICES, FACES)


BROKEN = {
    "index": (simple(objects=mesh_object(1, faces=[[0, 1, 2], [1, 2, 4]])), "object 1: triangle 1 (counted from 0)"),
    "no item": (simple(build=""), "has no items to build"),
    "no faces": (simple(objects=mesh_object(1, faces=[])), "has no faces"),
    "object": (simple('<item objectid="5"/>'), "refers to object '5', which the model does not contain"),
    "cycle": (simple(objects=components(1, '<component objectid="1"/>')), "an object contains itself"),
    "path": (simple('<item objectid="1" p:path="/3D/no.model"/>'), "refers to /3D/no.model, which the archive"),
    "transform": (simple('<item objectid="1" transform="1 0 0"/>'), "the transform '1 0 0' is not twelve numbers"),
    "text": (simple(objects=mesh_object(1).replace('y="0.0"', 'y="a lot"', 1)), "vertex 0 (counted from 0) of object"),
    "attribute": (simple(objects=mesh_object(1).replace(' z="1.0"', "", 1)), "vertex 3 (counted from 0) of object"),
    "XML": (("3dmodel.model", "<model>"), "its XML cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize(("part", "message"), BROKEN.values(), ids=BROKEN)
def test_what_is_wrong_is_said(tmp_path, part, message):
    with pytest.raises(MeshError, match=re.escape(message)):
        read(tmp_path, part)


def test_a_file_cut_anywhere_or_of_another_kind_is_an_error(tmp_path):
    data = package(simple())
    path = tmp_path / "thing.3mf"
    for length in range(1, len(data), 11):
        path.write_bytes(data[:length])
        with pytest.raises(MeshError, match="not a 3MF file, or it is damaged or truncated"):
            read_mesh(path)
    path.write_bytes(package())
    with pytest.raises(MeshError, match=r"refers to /3D/3dmodel\.model, which the archive does not contain"):
        read_mesh(path)


ROWS = '<vertex x="{}" y="{}" z="{}" />'
PLAIN_TRIANGLES = "".join('\n  <triangle v1="{}" v2="{}" v3="{}"/>'.format(*face) for face in FACES.tolist()) + "\n "


def with_tables(vertices, triangles):
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
    return model(f'<object id="1">{mesh}</object>', '<item objectid="1"/>').encode()


def test_rows_of_the_usual_layout_are_read_without_the_parser(tmp_path):
    text = with_tables("".join(ROWS.format(*row) for row in VERTICES.tolist()), PLAIN_TRIANGLES)
    tables = []
    shortened = threemf._shortened(text, tables)
    assert shortened.count(b"<heatwalk-table") == 2
    assert b"<vertex" not in shortened
    assert np.array_equal(tables[0], VERTICES)
    assert np.array_equal(tables[1], FACES)
    assert is_mesh(read(tmp_path, ("3dmodel.model", text.decode())), *TETRAHEDRON)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('x="1.0"', 'x="1.0 "'),
        ('x="1.0"', 'x=""'),
        ('x="1.0" y="0.0"', 'y="0.0" x="1.0"'),
        ('x="1.0"', 'x="&#49;"'),
        ('x="1.0"', "x='1.0'"),
        ('x="1.0"', 'x="one"'),
        ('<vertex x="1.0"', '<vertex/><vertex x="1.0"'),
        ("</vertices>", "</vertices >"),
        ("<vertices>", "<vertices><!-- -->"),
        ('v1="0"', 'v1="0" pid="1"'),
        ('v1="0"', 'v1="9"'),
        ("</triangles>", ""),
        ("</mesh>", "<vertices></vertices></mesh>"),
    ],
)
def test_rows_of_another_layout_are_read_or_rejected_as_by_the_parser_alone(tmp_path, before, after, monkeypatch):
    text = with_tables("".join(ROWS.format(*row) for row in VERTICES.tolist()), PLAIN_TRIANGLES).decode()
    text = text.replace(before, after, 1)
    results = []
    for _ in range(2):
        try:
            results.append(read(tmp_path, ("3dmodel.model", text)))
        except MeshError as error:
            results.append(str(error))
        monkeypatch.setattr(threemf, "_shortened", lambda model, tables: model)
    if isinstance(results[0], str):
        assert results[0] == results[1]
    else:
        assert is_mesh(results[0], results[1].vertices, results[1].faces)
