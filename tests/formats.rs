//! Every format reads what it wrote, every reader survives damage, and files of other programs read as they should.

#![expect(clippy::print_stderr, reason = "a skipped test says so")]

mod formats {
    mod corpus;
    mod damage;
    mod gmsh;
    mod parts;
    mod round_trip;
    mod spellings;
    mod tables;
}
