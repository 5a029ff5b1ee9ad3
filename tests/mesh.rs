//! From a Gmsh file to a mesh that can be computed on.

use fcm_fsi::mesh::{Mesh, import::import, quality::check};
use std::path::Path;

fn read(file: &str) -> Mesh {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let gmsh = io::gmsh::read(&path).unwrap();
    import(gmsh.nodes, gmsh.tets, &gmsh.triangles, gmsh.names).unwrap()
}

/// Sizes as Gmsh reports them; its sides are exact planes.
#[test]
fn the_still_water_tank() {
    let mesh = read("cases/still_water/tank.msh");
    let q = check(&mesh).unwrap();
    assert_eq!((q.nodes, q.tets), (1353, 5148));
    assert!((q.volume - 0.25).abs() < 1e-13);
    assert!(q.shape[0] > 0.25 && q.dihedral > 10.0, "{q}");
    let areas = [0.25, 0.25, 1.0, 1.0, 0.25, 0.25];
    assert_eq!(q.boundaries.len(), 6);
    for (i, (name, _, area)) in q.boundaries.iter().enumerate() {
        assert_eq!(name, ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"][i]);
        assert!((area - areas[i]).abs() < 1e-12, "{q}");
    }
    let planes = [0.0, 1.0, 0.0, 0.25, 0.0, 1.0];
    for f in &mesh.boundary {
        let name = f.name as usize;
        assert!(f.nodes.iter().all(|&n| mesh.nodes[n as usize][name / 2] == planes[name]));
    }
}

/// Two volumes that share a face, some sides without a name.
#[test]
fn sides_without_a_name_are_called_unnamed() {
    let mesh = read("io/tests/gmsh/tank_41_binary.msh");
    let q = check(&mesh).unwrap();
    let named: Vec<_> =
        q.boundaries.iter().map(|b| (&b.0[..], (b.2 * 1e9).round() / 1e9)).collect();
    let wanted = [("far end", 0.5), ("floor", 0.75), ("walls", 2.0), ("unnamed", 1.25)];
    assert_eq!(named, wanted);
    assert!((q.volume - 0.5).abs() < 1e-12, "{q}");
}
