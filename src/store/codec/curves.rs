//! Curves on a surface as columns: a row a curve, a row a point.

use super::super::columns::{ColumnReader, ColumnWriter};
use super::CodecError;
use crate::mesh::{Curve, Id, SurfacePoint};

/// A point on a vertex is an edge of that vertex twice, at 0.
pub(super) fn encode(writer: &mut ColumnWriter, curves: &[Curve]) {
    let rows = curves.iter().flat_map(|curve| {
        let [left, right] = curve.sides;
        [curve.points.len() as u32, u32::from(curve.is_closed), left, right]
    });
    writer.u32s(rows.collect::<Vec<_>>().into_iter());
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let ends = points().flat_map(|point| match point {
        SurfacePoint::Vertex(v) => [v.raw(); 2],
        SurfacePoint::Edge { edge, .. } => edge.map(Id::raw),
    });
    writer.u32s(ends.collect::<Vec<_>>().into_iter());
    let places = points().map(|point| match point {
        SurfacePoint::Vertex(_) => 0.0,
        SurfacePoint::Edge { t, .. } => *t,
    });
    writer.f64s(places.collect::<Vec<_>>().into_iter());
}

pub(super) fn decode(reader: &mut ColumnReader<'_>) -> Result<Vec<Curve>, CodecError> {
    let rows: Vec<u32> = reader.u32s()?.collect();
    let ends: Vec<u32> = reader.u32s()?.collect();
    let places: Vec<f64> = reader.f64s()?.collect();
    let ((rows, rest), (ends, odd)) = (rows.as_chunks::<4>(), ends.as_chunks::<2>());
    let total: u64 = rows.iter().map(|row| u64::from(row[0])).sum();
    if !rest.is_empty() || !odd.is_empty() || ends.len() != places.len() || total != places.len() as u64 {
        return Err(CodecError::Malformed("curves and their points differ in number"));
    }
    let points = ends.iter().zip(places).map(|(&ends, t)| point(ends, t)).collect::<Result<Vec<_>, _>>()?;
    let mut rest = points.as_slice();
    let mut curves = Vec::with_capacity(rows.len());
    for &[count, is_closed, left, right] in rows {
        let (own, tail) = rest.split_at(count as usize);
        if is_closed > 1 {
            return Err(CodecError::Malformed("a curve is closed or it is not"));
        }
        curves.push(Curve { points: own.to_vec(), is_closed: is_closed == 1, sides: [left, right] });
        rest = tail;
    }
    Ok(curves)
}

fn point(ends: [u32; 2], t: f64) -> Result<SurfacePoint, CodecError> {
    let [a, b] = ends;
    if a == b && t.to_bits() == 0 {
        Ok(SurfacePoint::Vertex(Id::from_raw(a)))
    } else if a < b && t > 0.0 && t < 1.0 {
        Ok(SurfacePoint::Edge { edge: ends.map(Id::from_raw), t })
    } else {
        Err(CodecError::Malformed("a point of a curve lies on no vertex and inside no edge"))
    }
}
