"""Expressions of the model language: text to tokens, trees and SymEngine."""
