//! Files written by Gmsh 4.15 and meshio 5.3 (numbers below from both programs), and damaged ones.

use super::*;

fn fixture(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gmsh");
    std::fs::read(folder.join(name)).unwrap()
}

fn parsed(name: &str) -> GmshMesh {
    parse(Path::new(name), &fixture(name)).unwrap()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[test]
fn four_formats_give_one_mesh() {
    let mesh = parsed("tank_41_ascii.msh");
    assert_eq!((mesh.nodes.len(), mesh.tets.len()), (39, 87));
    let volume: f64 = mesh
        .tets
        .iter()
        .map(|t| {
            let [a, b, c, d] = t.map(|n| mesh.nodes[n as usize]);
            dot(minus(d, a), cross(minus(b, a), minus(c, a))) / 6.0
        })
        .sum();
    assert!((volume - 0.5).abs() < 1e-14);
    assert_eq!(mesh.names, ["far end", "floor", "walls"]);
    for (name, (count, wanted)) in [(8, 0.5), (12, 0.75), (32, 2.0)].into_iter().enumerate() {
        let on: Vec<_> = mesh.triangles.iter().filter(|t| t.1 as usize == name).collect();
        let area: f64 = on
            .iter()
            .map(|t| {
                let [a, b, c] = t.0.map(|n| mesh.nodes[n as usize]);
                let n = cross(minus(b, a), minus(c, a));
                0.5 * dot(n, n).sqrt()
            })
            .sum();
        assert_eq!(on.len(), count);
        assert!((area - wanted).abs() < 1e-14);
    }
    let same = |other: &GmshMesh| {
        assert_eq!((&mesh.tets, &mesh.names), (&other.tets, &other.names));
        assert_eq!(mesh.triangles, other.triangles);
        // Text has 16 digits.
        for (a, b) in mesh.nodes.iter().zip(&other.nodes) {
            assert!(minus(*a, *b).iter().all(|d| d.abs() < 1e-15));
        }
    };
    for other in ["tank_41_binary", "tank_22_ascii", "tank_22_binary", "tank_parametric"] {
        same(&parsed(&format!("{other}.msh")));
    }
    for other in ["meshio_41_ascii", "meshio_41_binary", "meshio_22_ascii", "meshio_22_binary"] {
        same(&parsed(&format!("{other}.msh")));
    }
}

/// Every prefix is an error (or lacks only the last line's end); every damaged byte gives a mesh or
/// an error.
#[test]
fn damaged_files_are_errors() {
    for version in ["22", "41"] {
        for format in ["ascii", "binary"] {
            let name = format!("tank_{version}_{format}.msh");
            let bytes = fixture(&name);
            for length in 0..bytes.len() - 1 {
                let message = parse(Path::new("a"), &bytes[..length]).unwrap_err().to_string();
                assert!(message.starts_with("a:") || message.starts_with("a: "), "{message}");
            }
            let mut damaged = bytes.clone();
            for i in 0..bytes.len() {
                for byte in [0xff, b'9', b'-', bytes[i] ^ 1] {
                    damaged[i] = byte;
                    let _ = parse(Path::new("a"), &damaged);
                }
                damaged[i] = bytes[i];
            }
        }
    }
}

const ONE_TET: &str = "$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
2 7 \"floor\"
$EndPhysicalNames
$Nodes
4
10 0 0 0
20 1 0 0
4000000000 0 1 0
5 0 0 1
$EndNodes
$Elements
2
1 2 2 7 1 10 20 4000000000
2 4 2 1 1 10 20 4000000000 5
$EndElements
";

fn broken(from: &str, to: &str) -> String {
    assert!(ONE_TET.contains(from));
    let text = ONE_TET.replace("4000000000", "40").replacen(from, to, 1);
    match parse(Path::new("m.msh"), text.as_bytes()) {
        Ok(mesh) => format!("{mesh:?}"),
        Err(e) => e.to_string(),
    }
}

#[test]
fn tags_may_have_gaps() {
    let text = ONE_TET.replace("4000000000", "2000000000");
    let mesh = parse(Path::new("m.msh"), text.as_bytes()).unwrap();
    assert_eq!(mesh.tets, [[0, 1, 2, 3]]);
    assert_eq!(mesh.triangles, [([0, 1, 2], 0)]);
    let windows = ONE_TET.replace("4000000000", "40").replace('\n', "\r\n");
    assert_eq!(parse(Path::new("m.msh"), windows.as_bytes()).unwrap(), mesh);
}

#[test]
fn messages_name_the_line_and_what_to_do() {
    let export = "save it with Mesh.MshFileVersion = 4.1 (or 2.2)";
    for (from, to, message) in [
        ("2.2 0 8", "4 0 8", format!("m.msh:2: MSH version 4 is not read: {export}")),
        ("$MeshFormat", "$NOD", format!("m.msh:1: MSH version 1 is not read: {export}")),
        (
            "$MeshFormat",
            "solid",
            "m.msh:1: a section such as $Nodes expected, not \"solid\"".into(),
        ),
        (
            "$MeshFormat",
            "$Nodes",
            "m.msh:1: is not a Gmsh mesh: it does not begin with $MeshFormat".into(),
        ),
        (
            "2.2 0 8",
            "2.2 0 4",
            format!("m.msh:2: numbers of 4 bytes are not read: {export}, on 64 bits"),
        ),
        ("2 7 \"floor\"", "2 7 floor", "m.msh:6: physical group 7: a name in quotes expected".into()),
        (
            "2 7 \"floor\"",
            "2 8 \"floor\"",
            "m.msh: physical surface 7 has no name: in the .geo file write Physical \
             Surface(\"name\", 7) = ..."
                .into(),
        ),
        ("1\n2 7 ", "2\n2 8 \"wall\"\n2 7 ", "m.msh: physical surface \"wall\" has no triangles: mesh it".into()),
        ("20 1 0 0", "20 1 nan 0", "m.msh:11: node 20: its coordinate is NaN".into()),
        ("20 1 0 0", "20 1 x 0", "m.msh:11: a coordinate expected, not \"x\"".into()),
        ("20 1 0 0", "10 1 0 0", "m.msh: lists node 10 twice in $Nodes".into()),
        (
            "20 1 0 0",
            "20 1 0",
            "m.msh:14: a coordinate expected, not \"$EndNodes\"".into(),
        ),
        (
            "$Nodes\n4",
            "$Nodes\n3",
            "m.msh:13: $EndNodes expected: the section does not hold what its counts say".into(),
        ),
        (
            "$Nodes\n4",
            "$Nodes\n99999999999999",
            "m.msh:9: $Nodes announces 99999999999999 nodes; the rest of the file has room for 56 \
             at most"
                .into(),
        ),
        (
            "2 4 2 1 1 10 20",
            "2 4 2 1 1 10 21",
            "m.msh: a tetrahedron names node 21, which is not in $Nodes".into(),
        ),
        (
            "2 4 2",
            "2 5 2",
            "m.msh:18: element 2 is a hexahedron (type 5): only tetrahedra and triangles are read: \
             remove Recombine"
                .into(),
        ),
        (
            "2 4 2",
            "2 11 2",
            "m.msh:18: element 2 is a second-order tetrahedron (type 11): mesh with \
             Mesh.ElementOrder = 1 (gmsh -order 1)"
                .into(),
        ),
        (
            "$Elements\n2",
            "$Elements\n1",
            "m.msh:18: $EndElements expected: the section does not hold what its counts say".into(),
        ),
        ("$EndElements", "", "m.msh:20: the file ends inside $Elements, where $EndElements should be".into()),
    ] {
        assert_eq!(broken(from, to), message);
    }
    let surface_only = ONE_TET
        .replace("4000000000", "40")
        .replace("$Elements\n2", "$Elements\n1")
        .replace("2 4 2 1 1 10 20 40 5\n", "");
    let error = parse(Path::new("m.msh"), surface_only.as_bytes()).unwrap_err().to_string();
    assert!(error.starts_with("m.msh: has no tetrahedra: mesh the volume (gmsh -3)"), "{error}");
    let binary = fixture("tank_41_binary.msh");
    let error = parse(Path::new("m.msh"), &binary[..5000]).unwrap_err().to_string();
    assert!(error.starts_with("m.msh: at byte 5000: the file ends inside $"), "{error}");
    assert!(read(Path::new("/nowhere.msh")).unwrap_err().to_string().contains("/nowhere.msh"));
}
