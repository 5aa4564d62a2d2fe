"""Strokes of a record that goes back and forth: pieces between its reversals, slips in them, and
measured properties of strokes and cycles."""
