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
