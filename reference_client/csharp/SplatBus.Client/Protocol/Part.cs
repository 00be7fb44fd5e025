// SPDX-License-Identifier: MIT
using System.Collections.Generic;

namespace SplatBus
{
    /// <summary>A value and its place in the message.</summary>
    struct Part
    {
        readonly string pointer;

        internal Part(JsonValue value, string pointer)
        {
            Value = value;
            this.pointer = pointer;
        }

        internal readonly JsonValue Value;

        internal bool Has(string name, out Part part)
        {
            JsonValue member;
            bool there = Value.TryMember(name, out member);
            part = new Part(member, pointer + "/" + name);
            return there;
        }

        internal Part Member(string name, string requirement)
        {
            Part part;
            if (Value.Kind != JsonKind.Object) throw Broken("is no object", requirement);
            if (!Has(name, out part)) throw part.Broken("is missing", requirement);
            return part;
        }

        internal long Integer(long least, long most, string requirement)
        {
            long value;
            if (!Value.TryInteger(out value) || value < least || value > most) throw Broken("is no integer from " + least + " to " + most, requirement);
            return value;
        }

        internal long Multiple(int unit, long least, string requirement)
        {
            long value = Integer(least, Limits.MaxSafeInteger, requirement);
            if (value % unit != 0) throw Broken("is no multiple of " + unit, requirement);
            return value;
        }

        internal double Number(string requirement)
        {
            if (Value.Kind != JsonKind.Number) throw Broken("is no number", requirement);
            return Value.Number;
        }

        internal string Text(string requirement)
        {
            if (Value.Kind != JsonKind.String) throw Broken("is no string", requirement);
            return Value.Text;
        }

        internal string OneOf(string requirement, params string[] values)
        {
            foreach (string each in values) if (Value.Is(each)) return each;
            throw Broken("is none of " + string.Join(", ", values), requirement);
        }

        internal ProtocolException Broken(string what, string requirement)
        {
            return new ProtocolException(what + " [" + requirement + "]", pointer);
        }

        /// <summary>A string of so many characters: code points, not UTF-16 units.</summary>
        internal string Text(int least, int most, string requirement)
        {
            string text = Text(requirement);
            int characters = 0;
            foreach (char each in text) if (!char.IsLowSurrogate(each)) characters++;
            if (characters < least || characters > most) throw Broken("has " + characters + " characters, not " + least + " to " + most, requirement);
            return text;
        }

        /// <summary>An array of so many numbers.</summary>
        internal double[] Vector(int count, string requirement)
        {
            var numbers = new double[count];
            if (!Value.TryNumbers(numbers)) throw Broken("is no array of " + count + " numbers", requirement);
            return numbers;
        }

        /// <summary>The values of an array of so many.</summary>
        internal List<Part> Items(int least, int most, string requirement)
        {
            if (Value.Kind != JsonKind.Array || Value.Count < least || Value.Count > most) throw Broken("is no array of " + least + " to " + most, requirement);
            var items = new List<Part>(Value.Count);
            foreach (JsonValue each in Value) items.Add(new Part(each, pointer + "/" + items.Count));
            return items;
        }
    }
}
