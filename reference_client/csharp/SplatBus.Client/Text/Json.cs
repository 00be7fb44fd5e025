// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;
using System.Text;

namespace SplatBus
{
    public enum JsonKind : byte { Null, False, True, Number, String, Array, Object }

    /// <summary>
    /// The values of one payload, read strictly [JSN-1 to JSN-5]. One instance serves a connection:
    /// its table grows to the largest payload and is used again, so that reading allocates nothing.
    /// </summary>
    public sealed class Json
    {
        struct Node
        {
            public JsonKind Kind;
            /// <summary>Of a string, its text in the payload, without escapes.</summary>
            public int Start, Length;
            /// <summary>Of a member, its name in the payload.</summary>
            public int NameStart, NameLength;
            /// <summary>Of an array or object, how many values it has.</summary>
            public int Count;
            /// <summary>The index behind the last value inside of it.</summary>
            public int Behind;
            public double Number;
        }

        /// <summary>Members that are compared with one another; a set does it for more.</summary>
        const int FewMembers = 16;

        static readonly UTF8Encoding Utf8 = new UTF8Encoding(false, true);

        readonly int mostValues;
        Node[] nodes = new Node[64];
        int count;
        byte[] text;
        int first, at, end;

        /// <param name="mostValues">As many values as the payload may have [JSN-12, JSN-13].</param>
        public Json(int mostValues)
        {
            this.mostValues = mostValues;
        }

        /// <summary>Read a payload, whose escapes are replaced where they stand.</summary>
        /// <returns>Its object; valid until the next payload is read, or the bytes are changed.</returns>
        /// <exception cref="ProtocolException">It breaks a rule of the text: ignore it [JSN-8].</exception>
        public JsonValue Read(ArraySegment<byte> payload)
        {
            text = payload.Array;
            first = at = payload.Offset;
            end = at + payload.Count;
            count = 0;
            Space();
            if (at == end || text[at] != '{') throw Broken("the payload is no JSON object [JSN-1]");
            Value(1);
            Space();
            if (at != end) throw Broken("there is more behind the object [JSN-1]");
            return new JsonValue(this, 0);
        }

        internal JsonKind KindOf(int index) { return nodes[index].Kind; }
        internal int CountOf(int index) { return nodes[index].Count; }
        internal int Behind(int index) { return nodes[index].Behind; }
        internal double NumberOf(int index) { return nodes[index].Number; }
        internal string TextOf(int index) { return Utf8.GetString(text, nodes[index].Start, nodes[index].Length); }
        internal string NameOf(int index) { return Utf8.GetString(text, nodes[index].NameStart, nodes[index].NameLength); }
        internal bool TextIs(int index, string ascii) { return Same(nodes[index].Start, nodes[index].Length, ascii); }
        internal bool NameIs(int index, string ascii) { return Same(nodes[index].NameStart, nodes[index].NameLength, ascii); }

        bool Same(int start, int length, string ascii)
        {
            if (length != ascii.Length) return false;
            for (int i = 0; i < length; i++) if (text[start + i] != ascii[i]) return false;
            return true;
        }

        int Value(int depth)
        {
            if (count == mostValues) throw Broken("more than " + mostValues + " values [JSN-12]");
            if (count == nodes.Length) Array.Resize(ref nodes, Math.Min(mostValues, 2 * count));
            int index = count++;
            nodes[index] = default(Node);
            switch (at < end ? text[at] : (byte)0)
            {
                case (byte)'{': Object(index, depth); break;
                case (byte)'[': Items(index, depth); break;
                case (byte)'"':
                    nodes[index].Kind = JsonKind.String;
                    String(out nodes[index].Start, out nodes[index].Length);
                    break;
                case (byte)'n': Literal(index, "null", JsonKind.Null); break;
                case (byte)'f': Literal(index, "false", JsonKind.False); break;
                case (byte)'t': Literal(index, "true", JsonKind.True); break;
                default: Number(index); break;
            }
            nodes[index].Behind = count;
            return index;
        }

        void Object(int index, int depth)
        {
            nodes[index].Kind = JsonKind.Object;
            Enter(depth);
            HashSet<string> names = null;
            while (!Leave('}', ref nodes[index].Count))
            {
                int start, length;
                if (at == end || text[at] != '"') throw Broken("a member has no name [JSN-1]");
                String(out start, out length);
                Space();
                if (at == end || text[at] != ':') throw Broken("a name has no value [JSN-1]");
                at++;
                Space();
                int member = Value(depth + 1);
                nodes[member].NameStart = start;
                nodes[member].NameLength = length;
                nodes[index].Count++;
                if (!IsNew(index, member, ref names)) throw Broken("a name stands twice in an object [JSN-3]");
            }
        }

        void Items(int index, int depth)
        {
            nodes[index].Kind = JsonKind.Array;
            Enter(depth);
            while (!Leave(']', ref nodes[index].Count))
            {
                Value(depth + 1);
                nodes[index].Count++;
            }
        }

        void Enter(int depth)
        {
            if (depth > Limits.MaxJsonDepth) throw Broken("more than " + Limits.MaxJsonDepth + " levels [JSN-5]");
            at++;
        }

        /// <summary>Pass the bracket that closes, or else the comma before the next value.</summary>
        bool Leave(char bracket, ref int before)
        {
            Space();
            if (at < end && text[at] == bracket)
            {
                at++;
                return true;
            }
            if (before == 0) return false;
            if (at == end || text[at] != ',') throw Broken("neither ',' nor '" + bracket + "' [JSN-1]");
            at++;
            Space();
            return false;
        }

        bool IsNew(int parent, int member, ref HashSet<string> names)
        {
            if (nodes[parent].Count <= FewMembers)
            {
                for (int other = parent + 1; other < member; other = nodes[other].Behind)
                    if (SameName(other, member)) return false;
                return true;
            }
            if (names == null)
            {
                names = new HashSet<string>(StringComparer.Ordinal);
                for (int other = parent + 1; other < member; other = nodes[other].Behind) names.Add(NameOf(other));
            }
            return names.Add(NameOf(member));
        }

        bool SameName(int one, int other)
        {
            int length = nodes[one].NameLength;
            return length == nodes[other].NameLength
                && text.AsSpan(nodes[one].NameStart, length).SequenceEqual(text.AsSpan(nodes[other].NameStart, length));
        }

        void Literal(int index, string word, JsonKind kind)
        {
            if (end - at < word.Length || !Same(at, word.Length, word)) throw Broken("neither a value nor 'null', 'true', 'false' [JSN-1]");
            nodes[index].Kind = kind;
            at += word.Length;
        }

        void Number(int index)
        {
            int start = at;
            if (at < end && text[at] == '-') at++;
            if (at < end && text[at] == '0') at++; else Digits();
            if (at < end && text[at] == '.') { at++; Digits(); }
            if (at < end && (text[at] == 'e' || text[at] == 'E'))
            {
                at++;
                if (at < end && (text[at] == '+' || text[at] == '-')) at++;
                Digits();
            }
            nodes[index].Kind = JsonKind.Number;
            nodes[index].Number = Numbers.Read(new ReadOnlySpan<byte>(text, start, at - start));
            if (double.IsInfinity(nodes[index].Number)) throw Broken("a number overflows [JSN-4]");
        }

        void Digits()
        {
            int start = at;
            while (at < end && text[at] >= '0' && text[at] <= '9') at++;
            if (at == start) throw Broken("no JSON value [JSN-1, JSN-4]");
        }

        /// <summary>Read a string, and write what its escapes mean over them: that is never longer.</summary>
        void String(out int start, out int length)
        {
            start = ++at;
            int to = at;
            while (true)
            {
                if (at == end) throw Broken("a string does not end [JSN-1]");
                byte each = text[at];
                if (each == '"') break;
                if (each == '\\') Escape(ref to);
                else if (each < 0x20) throw Broken("a control character in a string [JSN-1]");
                else if (each < 0x80) { text[to++] = each; at++; }
                else Beyond(ref to);
            }
            at++;
            length = to - start;
        }

        void Escape(ref int to)
        {
            int which = at + 1 < end ? "\"\\/bfnrt".IndexOf((char)text[at + 1]) : -1;
            if (which >= 0)
            {
                text[to++] = (byte)"\"\\/\b\f\n\r\t"[which];
                at += 2;
                return;
            }
            int code = Unit();
            if (code >= 0xd800 && code < 0xdc00 && at + 1 < end && text[at] == '\\')
            {
                int low = Unit();
                if (low < 0xdc00 || low > 0xdfff) throw Broken("half a surrogate pair [JSN-1]");
                code = 0x10000 + (code - 0xd800 << 10) + low - 0xdc00;
            }
            else if (code >= 0xd800 && code < 0xe000) throw Broken("half a surrogate pair [JSN-1]");
            if (code < 0x80) { text[to++] = (byte)code; return; }
            int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
            text[to++] = (byte)((more == 1 ? 0xc0 : more == 2 ? 0xe0 : 0xf0) | code >> 6 * more);
            while (more-- > 0) text[to++] = (byte)(0x80 | code >> 6 * more & 0x3f);
        }

        /// <summary>The code unit of \uXXXX.</summary>
        int Unit()
        {
            if (end - at < 6 || text[at + 1] != 'u') throw Broken("no such escape [JSN-1]");
            int code = 0;
            for (int i = at + 2; i < at + 6; i++)
            {
                int digit = "0123456789abcdef".IndexOf(char.ToLowerInvariant((char)text[i]));
                if (digit < 0) throw Broken("no such escape [JSN-1]");
                code = 16 * code + digit;
            }
            at += 6;
            return code;
        }

        /// <summary>A character beyond ASCII: the shortest form of it, and no surrogate.</summary>
        void Beyond(ref int to)
        {
            byte lead = text[at];
            int more = lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
            if (lead < 0xc2 || lead > 0xf4 || end - at <= more) throw Broken("no UTF-8 [JSN-1]");
            int code = lead & (0x3f >> more);
            for (int i = 1; i <= more; i++)
            {
                if ((text[at + i] & 0xc0) != 0x80) throw Broken("no UTF-8 [JSN-1]");
                code = code << 6 | text[at + i] & 0x3f;
            }
            int least = more == 1 ? 0x80 : more == 2 ? 0x800 : 0x10000;
            if (code < least || code > 0x10ffff || code >= 0xd800 && code < 0xe000) throw Broken("no UTF-8 [JSN-1]");
            for (int i = 0; i <= more; i++) text[to++] = text[at++];
        }

        void Space()
        {
            while (at < end && (text[at] == ' ' || text[at] == '\n' || text[at] == '\r' || text[at] == '\t')) at++;
        }

        ProtocolException Broken(string what)
        {
            return new ProtocolException(what, at - first);
        }
    }

    /// <summary>One value of a payload that was read.</summary>
    public struct JsonValue
    {
        readonly Json json;
        readonly int index;

        internal JsonValue(Json json, int index)
        {
            this.json = json;
            this.index = index;
        }

        public JsonKind Kind { get { return json.KindOf(index); } }

        /// <summary>How many values an array or object has; 0 for all others.</summary>
        public int Count { get { return json.CountOf(index); } }

        /// <summary>The number; 0 for all that is none.</summary>
        public double Number { get { return json.NumberOf(index); } }

        /// <summary>The text of a string, made anew; empty for all that is none.</summary>
        public string Text { get { return json.TextOf(index); } }

        /// <summary>The name of a member, made anew.</summary>
        public string Name { get { return json.NameOf(index); } }

        /// <summary>Whether it is this string, which is of ASCII.</summary>
        public bool Is(string ascii)
        {
            return Kind == JsonKind.String && json.TextIs(index, ascii);
        }

        /// <summary>An integer from 0 to 2⁵³ − 1, however it is spelt.</summary>
        public bool TryInteger(out long value)
        {
            double number = Number;
            bool found = Kind == JsonKind.Number && number >= 0 && number <= Limits.MaxSafeInteger && Math.Floor(number) == number;
            value = found ? (long)number : 0;
            return found;
        }

        /// <summary>An array of exactly as many numbers as there is room for.</summary>
        public bool TryNumbers(Span<double> to)
        {
            if (Kind != JsonKind.Array || Count != to.Length) return false;
            int at = 0;
            foreach (JsonValue each in this)
            {
                if (each.Kind != JsonKind.Number) return false;
                to[at++] = each.Number;
            }
            return true;
        }

        /// <summary>The member of an object with this name, which is of ASCII.</summary>
        public bool TryMember(string name, out JsonValue member)
        {
            if (Kind == JsonKind.Object)
                foreach (JsonValue each in this)
                    if (json.NameIs(each.index, name))
                    {
                        member = each;
                        return true;
                    }
            member = default(JsonValue);
            return false;
        }

        /// <summary>Goes through the values of an array or object.</summary>
        public Inside GetEnumerator()
        {
            return new Inside(json, index);
        }

        public struct Inside
        {
            readonly Json json;
            readonly int behind;
            int index, next;

            internal Inside(Json json, int parent)
            {
                this.json = json;
                behind = json.Behind(parent);
                index = parent;
                next = parent + 1;
            }

            public JsonValue Current { get { return new JsonValue(json, index); } }

            public bool MoveNext()
            {
                if (next >= behind) return false;
                index = next;
                next = json.Behind(index);
                return true;
            }
        }
    }
}
