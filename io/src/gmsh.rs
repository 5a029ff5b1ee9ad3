//! Gmsh meshes: MSH 2.2 and 4.1, ASCII and binary (<https://gmsh.info/doc/texinfo/gmsh.html>, "Gmsh
//! file formats"). Of the many things a file may hold, a flow needs the nodes, the tetrahedra and the
//! triangles of named physical surfaces; points, lines and other sections are passed over. A file
//! from a damaged disk or a hostile hand is an error with its place, never a panic or a large
//! allocation.

mod cursor;
mod sections;

use crate::Error;
use cursor::Cursor;
use sections::Raw;
use std::collections::BTreeMap;
use std::path::Path;

/// What a flow needs of a Gmsh file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GmshMesh {
    /// Coordinates, in the order of the file.
    pub nodes: Vec<[f64; 3]>,
    /// Corners as indices into `nodes`, in the order and orientation of the file.
    pub tets: Vec<[u32; 4]>,
    /// Corners and name (index into `names`) of every triangle on a physical surface; a triangle on
    /// two surfaces stands twice.
    pub triangles: Vec<([u32; 3], u32)>,
    /// Names of the physical surfaces, each once.
    pub names: Vec<String>,
}

/// Reads a file.
///
/// # Errors
/// The file cannot be opened, or `parse` finds something wrong.
pub fn read(path: &Path) -> Result<GmshMesh, Error> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    parse(path, &bytes)
}

/// The mesh in the bytes of a file; `path` is for messages.
///
/// # Errors
/// Other versions, other element types, counts that disagree with the contents, numbers that are
/// none, nodes that do not exist, physical surfaces without a name: with line (ASCII) or byte
/// offset (binary) and what to do.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<GmshMesh, Error> {
    let mut cursor = Cursor::new(path, bytes);
    let version = sections::format(&mut cursor)?;
    let mut raw = Raw::default();
    while let Some(name) = cursor.section()? {
        match &name[..] {
            "PhysicalNames" => sections::physical_names(&mut cursor, &mut raw)?,
            "Entities" => sections::entities(&mut cursor, &mut raw)?,
            "Nodes" => sections::nodes(&mut cursor, version, &mut raw)?,
            "Elements" => sections::elements(&mut cursor, version, &mut raw)?,
            "PartitionedEntities" => {
                return Err(cursor.fail(
                    "the mesh was partitioned by Gmsh; save it unpartitioned (Mesh > Unpartition): \
                     it is split over ranks when it is read",
                ));
            }
            _ => {
                cursor.skip_section(&name)?;
                continue;
            }
        }
        cursor.end_of(&name)?;
    }
    resolve(path, raw)
}

/// Tags become indices, physical numbers become names.
fn resolve(path: &Path, raw: Raw) -> Result<GmshMesh, Error> {
    let Some((tags, nodes)) = raw.nodes else {
        return Err(Error::file(path, "has no section $Nodes"));
    };
    let Some((triangles, tets)) = raw.elements else {
        return Err(Error::file(path, "has no section $Elements"));
    };
    if tets.is_empty() {
        return Err(Error::file(
            path,
            "has no tetrahedra: mesh the volume (gmsh -3) and, if there are physical groups, put it \
             into one",
        ));
    }
    if nodes.len().max(tets.len()) >= u32::MAX as usize {
        return Err(Error::file(
            path,
            format!("has {} nodes and {} tetrahedra: too many", nodes.len(), tets.len()),
        ));
    }
    let index = TagIndex::new(&tags)
        .map_err(|tag| Error::file(path, format!("lists node {tag} twice in $Nodes")))?;
    let find = |element: &str, tag: u64| {
        index.find(tag).ok_or_else(|| {
            Error::file(path, format!("{element} names node {tag}, which is not in $Nodes"))
        })
    };
    let mut mesh = GmshMesh { nodes, ..GmshMesh::default() };
    for corners in tets {
        let mut tet = [0; 4];
        for (n, tag) in tet.iter_mut().zip(corners) {
            *n = find("a tetrahedron", tag)?;
        }
        mesh.tets.push(tet);
    }
    // Which name each physical surface has, as an index; two surfaces may share a name.
    let mut by_number = BTreeMap::new();
    for ((dimension, number), name) in raw.names {
        if dimension == 2 {
            let known = mesh.names.iter().position(|n| *n == name);
            by_number.insert(
                number,
                known.unwrap_or_else(|| {
                    mesh.names.push(name);
                    mesh.names.len() - 1
                }) as u32,
            );
        }
    }
    for (corners, group) in triangles {
        let mut nodes = [0; 3];
        for (n, tag) in nodes.iter_mut().zip(corners) {
            *n = find("a triangle", tag)?;
        }
        let single;
        let numbers = match group {
            sections::Group::Physical(0) => continue,
            sections::Group::Physical(number) => {
                single = [number];
                &single[..]
            }
            sections::Group::Entity(tag) => {
                raw.surfaces.get(&tag).map_or(&[][..], |numbers| &numbers[..])
            }
        };
        for number in numbers {
            let name = by_number.get(number).ok_or_else(|| {
                Error::file(
                    path,
                    format!(
                        "physical surface {number} has no name: in the .geo file write Physical \
                         Surface(\"name\", {number}) = ..."
                    ),
                )
            })?;
            mesh.triangles.push((nodes, *name));
        }
    }
    let mut used = vec![false; mesh.names.len()];
    mesh.triangles.iter().for_each(|t| used[t.1 as usize] = true);
    match used.iter().position(|used| !used) {
        None => Ok(mesh),
        Some(empty) => Err(Error::file(
            path,
            format!("physical surface \"{}\" has no triangles: mesh it", mesh.names[empty]),
        )),
    }
}

/// Index of each node by its tag: a table where tags are dense, else a sorted list.
enum TagIndex {
    Dense { first: u64, index: Vec<u32> },
    Sparse(Vec<(u64, u32)>),
}

impl TagIndex {
    /// `Err`: the tag that stands twice.
    fn new(tags: &[u64]) -> Result<Self, u64> {
        let first = tags.iter().copied().min().unwrap_or(0);
        let span = tags.iter().copied().max().unwrap_or(0) - first;
        if span < 4 * tags.len() as u64 {
            let mut index = vec![u32::MAX; span as usize + 1];
            for (i, &tag) in tags.iter().enumerate() {
                let place = &mut index[(tag - first) as usize];
                if *place != u32::MAX {
                    return Err(tag);
                }
                *place = i as u32;
            }
            return Ok(Self::Dense { first, index });
        }
        let mut list: Vec<_> = tags.iter().zip(0..).map(|(&tag, i)| (tag, i)).collect();
        list.sort_unstable();
        match list.windows(2).find(|w| w[0].0 == w[1].0) {
            Some(twice) => Err(twice[0].0),
            None => Ok(Self::Sparse(list)),
        }
    }

    fn find(&self, tag: u64) -> Option<u32> {
        match self {
            Self::Dense { first, index } => {
                let i = *index.get(usize::try_from(tag.checked_sub(*first)?).ok()?)?;
                (i != u32::MAX).then_some(i)
            }
            Self::Sparse(list) => {
                list.binary_search_by_key(&tag, |l| l.0).ok().map(|place| list[place].1)
            }
        }
    }
}

#[cfg(test)]
mod tests;
