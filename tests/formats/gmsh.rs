//! Gmsh files whose entities are more than a plain list.

use meshmill::format::{Format, read};
use meshmill::mesh::Soup;
use meshmill::watch::Watch;

fn mesh(text: &str) -> Result<Soup, String> {
    read(Format::Msh, text.as_bytes(), &Watch::silent()).map(|(soup, _)| soup).map_err(|error| error.to_string())
}

/// Names and sizes of all groups.
fn groups(soup: &Soup) -> Vec<String> {
    soup.carried.groups.list().map(|(kind, name, size)| format!("{kind} {name} {size}")).collect()
}

/// Two triangles, pieces 7 and 8 of surface 1, with the line 21 between them and the line 22, a piece of curve 3.
/// `own` are the groups of the pieces, `whole` those of the surface.
fn partitioned(own: &str, whole: &str) -> String {
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 5 \"rim\"\n2 11 \"two words\"\n$EndPhysicalNames\n\
         $Entities\n0 1 1 0\n3 0 0 0 1 0 0 1 5 0\n1 0 0 0 1 1 0 {whole} 0\n$EndEntities\n\
         $PartitionedEntities\n2\n1\n9 1\n0 2 2 0\n21 2 1 2 1 2 0 0 0 1 1 0 0 0\n22 1 3 1 1 0 0 0 1 0 0 1 5 0\n\
         7 2 1 1 1 0 0 0 1 1 0 {own} 0\n8 2 1 1 2 0 0 0 1 1 0 {own} 0\n$EndPartitionedEntities\n\
         $Nodes\n1 4 1 4\n2 7 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n$EndNodes\n\
         $Elements\n4 4 1 4\n1 21 1 1\n1 1 3\n1 22 1 1\n2 1 2\n2 7 2 1\n3 1 2 3\n2 8 2 1\n4 1 3 4\n$EndElements\n"
    )
}

#[test]
fn pieces_of_a_partitioned_mesh_are_in_the_groups_of_the_user() {
    let soup = mesh(&partitioned("1 11", "1 11")).unwrap();
    assert_eq!(groups(&soup), ["faces two words 2", "edges rim 1"]);
    let soup = mesh(&partitioned("0", "1 11")).unwrap();
    assert_eq!(groups(&soup), ["faces two words 2", "edges rim 1"], "a piece without groups has those of the whole");
}

#[test]
fn a_partitioned_mesh_without_groups_has_its_surfaces_and_no_pieces() {
    let text = partitioned("0", "0").replace("0 0 1 5 0", "0 0 0 0");
    assert_eq!(groups(&mesh(&text).unwrap()), ["edges curve_3 1"]);
}

#[test]
fn elements_of_an_entity_that_is_not_defined_are_an_error() {
    let error = mesh(&partitioned("0", "0").replace("\n2 8 2 1\n4", "\n2 6 2 1\n4")).unwrap_err();
    assert!(error.contains("surface 6 does not exist; 3 are known here"), "{error}");
}

const FOUR: &str = "$MeshFormat\n4 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 1 \"domain\"\n$EndPhysicalNames\n\
    $Entities\n1 1 1 0\n1 0 0 0 0 0 0 0\n4 0 0 0 1 0 0 0 2 1 -2\n8 0 0 0 1 1 0 1 1 1 4\n$EndEntities\n\
    $Nodes\n2 3\n1 0 0 1\n1 0 0 0\n8 2 1 2\n2 1 0 0 .5 .5\n3 0 1 0 .5 .5\n$EndNodes\n\
    $Elements\n1 1\n8 2 2 1\n1 1 2 3\n$EndElements\n";

#[test]
fn version_1_is_named() {
    let error = read(Format::Msh, b"$NOD\n1\n1 0 0 0\n$ENDNOD\n", &Watch::silent()).unwrap_err();
    assert!(error.remedy.as_ref().is_some_and(|remedy| remedy.contains("version 1")), "{error:?}");
}

#[test]
fn version_4_0_is_read_however_it_is_written() {
    for head in ["4 0 8", "4.0 0 8"] {
        let soup = mesh(&FOUR.replace("4 0 8", head)).unwrap();
        assert_eq!((soup.points.len(), groups(&soup)), (3, vec!["faces domain 1".to_owned()]));
        assert_eq!(soup.points.as_slice()[2].to_array(), [0.0, 1.0, 0.0]);
    }
    let error = mesh(&FOUR.replace("4 0 8", "5 0 8")).unwrap_err();
    assert!(error.contains("version 5 is not supported"), "{error}");
}

#[test]
fn a_binary_file_of_version_4_0() {
    let mut bytes = b"$MeshFormat\n4 1 8\n\x01\x00\x00\x00\n$EndMeshFormat\n$Nodes\n".to_vec();
    let int = |bytes: &mut Vec<u8>, all: &[i32]| bytes.extend(all.iter().flat_map(|i| i.to_le_bytes()));
    let size = |bytes: &mut Vec<u8>, all: &[u64]| bytes.extend(all.iter().flat_map(|i| i.to_le_bytes()));
    size(&mut bytes, &[1, 3]);
    int(&mut bytes, &[8, 2, 0]);
    size(&mut bytes, &[3]);
    for (tag, point) in [(1, [0.0_f64, 0.0, 0.0]), (2, [1.0, 0.0, 0.0]), (3, [0.0, 1.0, 0.0])] {
        int(&mut bytes, &[tag]);
        bytes.extend(point.iter().flat_map(|x| x.to_le_bytes()));
    }
    bytes.extend(b"\n$EndNodes\n$Elements\n");
    size(&mut bytes, &[1, 1]);
    int(&mut bytes, &[8, 2, 2]);
    size(&mut bytes, &[1]);
    int(&mut bytes, &[1, 1, 2, 3]);
    bytes.extend(b"\n$EndElements\n");
    let (soup, _) = read(Format::Msh, &bytes, &Watch::silent()).unwrap();
    assert_eq!((soup.points.len(), soup.faces.len()), (3, 1));
}

#[test]
fn volumes_of_gmsh_are_their_skin_in_their_groups() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 9 \"body\"\n$EndPhysicalNames\n\
        $Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n$Elements\n1\n1 4 2 9 1 1 2 3 4\n$EndElements\n";
    let soup = mesh(text).unwrap();
    assert_eq!((soup.faces.len(), groups(&soup)), (4, vec!["faces body 4".to_owned()]));
    let data = "$ElementData\n1\n\"heat\"\n1\n0\n3\n0\n1\n1\n1 2.5\n$EndElementData\n";
    let soup = mesh(&format!("{text}{data}")).unwrap();
    assert_eq!(soup.carried.fields[0].values, [2.5; 4]);
}
