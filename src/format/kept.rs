//! What a file holds of the mesh that was written into it: the file decides, not what is known of its format.

use std::collections::BTreeMap;

use crate::mesh::{Soup, Support};
use crate::terminal::printable;

/// What a mesh has and the mesh that was read from its file has not, in words, one entry a kind or group:
/// ``edge groups `rim`, `seam` ``, ``33 of 183 faces in `B` ``. Empty where the file holds everything.
///
/// Linear in both.
pub fn not_kept(before: &Soup, after: &Soup) -> Vec<String> {
    let mut lost = Vec::new();
    if after.faces.len() < before.faces.len() {
        lost.push(format!("{} of {} faces", before.faces.len() - after.faces.len(), before.faces.len()));
    }
    for ((kind, before), (_, after)) in holdings(before).into_iter().zip(holdings(after)) {
        let gone: Vec<&str> = before.keys().filter(|name| !after.contains_key(*name)).map(String::as_str).collect();
        if !gone.is_empty() {
            lost.push(format!("{} {}", kind.title, shortened(&gone)));
        }
        for (name, size) in &before {
            if let Some(now) = after.get(name).filter(|now| *now < size) {
                let name = printable(name);
                lost.push(format!("{} of {size} {} in `{name}`", size - now, kind.members));
            }
        }
    }
    lost
}

/// The same for groups alone.
pub fn groups_not_kept(before: &Soup, after: &Soup) -> Vec<String> {
    let bare = |soup: &Soup| {
        let mut bare = Soup::default();
        bare.carried.groups.clone_from(&soup.carried.groups);
        bare.carried.regions.clone_from(&soup.carried.regions);
        bare
    };
    not_kept(&bare(before), &bare(after))
}

/// A kind of thing that a mesh carries.
struct Kind {
    title: &'static str,
    members: &'static str,
}

/// Names and sizes of all that a mesh carries and a file may hold, by kind.
fn holdings(soup: &Soup) -> [(Kind, BTreeMap<String, usize>); 5] {
    let carried = &soup.carried;
    let regions = carried.regions.iter().flat_map(|regions| {
        let mut sizes = vec![0; regions.names.len()];
        for &label in regions.labels.as_slice() {
            if let Some(size) = sizes.get_mut(label as usize) {
                *size += 1;
            }
        }
        regions.names.iter().cloned().zip(sizes)
    });
    let groups = |kind: &str| {
        let own = carried.groups.list().filter(move |&(k, ..)| k == kind);
        own.map(|(_, name, size)| (name.to_owned(), size)).collect::<BTreeMap<_, _>>()
    };
    let fields = |support: Support| {
        let own = carried.fields.iter().filter(move |field| field.support == support);
        own.map(|field| (field.name.clone(), field.components)).collect()
    };
    let kind = |title, members| Kind { title, members };
    let faces = regions.chain(groups("faces")).collect();
    [
        (kind("face groups", "faces"), faces),
        (kind("edge groups", "edges"), groups("edges")),
        (kind("vertex groups", "vertices"), groups("vertices")),
        (kind("fields on vertices", "components"), fields(Support::Vertex)),
        (kind("fields on faces", "components"), fields(Support::Face)),
    ]
}

/// Some names in a line.
fn shortened(names: &[&str]) -> String {
    const MOST: usize = 5;
    let shown: Vec<String> = names.iter().take(MOST).map(|name| format!("`{}`", printable(name))).collect();
    let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
    shown.join(", ") + &more
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::FaceId;

    fn with_groups(groups: &[(&str, u32)]) -> Soup {
        let mut soup = Soup::default();
        for (name, size) in groups {
            soup.carried.groups.faces.insert((*name).to_owned(), (0..*size).map(FaceId::from_raw).collect());
        }
        soup
    }

    #[test]
    fn each_group_is_compared_for_itself() {
        let before = with_groups(&[("A", 150), ("B", 183), ("C\u{1b}", 2)]);
        // As many members as before on the whole.
        let after = with_groups(&[("A", 190), ("B", 150)]);
        assert_eq!(not_kept(&before, &after), ["face groups `C\\u{1b}`", "33 of 183 faces in `B`"]);
        assert_eq!(not_kept(&before, &before), [""; 0]);
        assert_eq!(groups_not_kept(&before, &after).len(), 2);
    }
}
