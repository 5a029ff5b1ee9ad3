//! Triangle surfaces of files: STL (ASCII and binary) and OBJ (polygons are cut into triangles).
//!
//! What a surface is good for (closed, the right side out) is not judged here.

use crate::Error;
use std::io::{BufReader, Cursor};
use std::path::Path;

/// Triangles as a file has them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceFile {
    /// Places, in the units of the file.
    pub vertices: Vec<[f64; 3]>,
    /// Corners as indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
}

/// Reads `name.stl` or `name.obj`.
///
/// # Errors
/// Another ending, a file that cannot be read, is broken, has no triangles or numbers that are none.
pub fn read(path: &Path) -> Result<SurfaceFile, Error> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    parse(path, &bytes)
}

/// The surface in the bytes of a file; `path` gives the ending, and is for messages.
///
/// # Errors
/// As `read`.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<SurfaceFile, Error> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let surface = match &ending[..] {
        "stl" => stl(path, bytes)?,
        "obj" => obj(path, bytes)?,
        _ => {
            return Err(Error::file(
                path,
                "is not called .stl or .obj: no other surfaces are read",
            ));
        }
    };
    if surface.triangles.is_empty() {
        return Err(Error::file(path, "has no triangles"));
    }
    if let Some(i) = surface.vertices.iter().position(|v| !v.iter().all(|x| x.is_finite())) {
        return Err(Error::file(path, format!("vertex {} is no place", i + 1)));
    }
    Ok(surface)
}

fn stl(path: &Path, bytes: &[u8]) -> Result<SurfaceFile, Error> {
    let broken = |e| Error::file(path, format!("is no whole STL file: {e}"));
    let mesh = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(broken)?;
    let mut surface = SurfaceFile {
        vertices: mesh.vertices.iter().map(|v| [0, 1, 2].map(|k| f64::from(v[k]))).collect(),
        triangles: Vec::with_capacity(mesh.faces.len()),
    };
    for face in &mesh.faces {
        surface.triangles.push(face.vertices.map(|v| v as u32));
    }
    Ok(surface)
}

fn obj(path: &Path, bytes: &[u8]) -> Result<SurfaceFile, Error> {
    let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) =
        tobj::load_obj_buf(&mut BufReader::new(Cursor::new(bytes)), &options, no_materials)
            .map_err(|e| Error::file(path, format!("is no whole OBJ file: {e}")))?;
    let mut surface = SurfaceFile::default();
    for model in models {
        let first = surface.vertices.len() as u32;
        surface.vertices.extend(model.mesh.positions.as_chunks::<3>().0);
        let triangles = model.mesh.indices.as_chunks::<3>().0;
        surface.triangles.extend(triangles.iter().map(|t| t.map(|v| first + v)));
    }
    Ok(surface)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: &str = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
        vertex 0 1 0\nendloop\nendfacet\nendsolid s\n";

    fn read(name: &str, bytes: &[u8]) -> Result<SurfaceFile, String> {
        parse(Path::new(name), bytes).map_err(|e| e.to_string())
    }

    fn binary(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        // A header that begins like an ASCII file, as some programs write it.
        let mut bytes = b"solid".to_vec();
        bytes.resize(80, b' ');
        bytes.extend((triangles.len() as u32).to_le_bytes());
        for t in triangles {
            bytes.extend([0; 12]);
            bytes.extend(t.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn stl_in_both_forms() {
        let ascii = read("a.stl", CORNER.as_bytes()).unwrap();
        assert_eq!(ascii.triangles, [[0, 1, 2]]);
        let two = [
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]],
        ];
        let surface = read("A.STL", &binary(&two)).unwrap();
        assert_eq!((surface.vertices.len(), surface.triangles.len()), (4, 2));
        assert_eq!(surface.vertices[surface.triangles[1][2] as usize], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn obj_polygons_become_triangles() {
        let text = "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\no b\nv 0 0 1\nf 1 2 5\n";
        let surface = read("a.obj", text.as_bytes()).unwrap();
        assert_eq!(surface.triangles.len(), 3);
        let last = surface.triangles[2].map(|v| surface.vertices[v as usize]);
        assert_eq!(last, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    }

    #[test]
    fn what_is_no_surface_is_refused() {
        assert!(read("a.ply", b"").unwrap_err().contains(".obj"));
        assert!(read("a.stl", b"").is_err());
        assert!(read("a.stl", &CORNER.as_bytes()[..60]).is_err());
        assert!(read("a.stl", &binary(&[[[f32::NAN; 3]; 3]])).unwrap_err().contains("vertex 1"));
        // A count that the file does not hold.
        let mut long = binary(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
        long[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(read("a.stl", &long).is_err());
        assert!(read("a.obj", b"v 0 0 0\nf 1 2 9\n").is_err());
        assert!(read("a.obj", b"v 0 0 0\n").unwrap_err().contains("no triangles"));
    }
}
